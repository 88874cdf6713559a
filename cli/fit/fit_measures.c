/* Measures the fitted shape, for --measure. */
#include "fit_command.h"

sdm_status cli_fit_prepare_measures(cli_fit *f, sdm_error *err)
{
    const sdm_status s = cli_read_depths(f->args, f->shape, &f->depths, err);
    if (s || !f->args->measure) return s;
    return sdm_shape_measure(f->shape, f->start, f->depths.mm, f->depths.n, &f->measures, err);
}

sdm_status cli_fit_measure(cli_fit *f, sdm_error *err)
{
    if (!f->args->measure) return SDM_OK;
    return sdm_fit_measure(f->shape, &f->result, f->depths.mm, f->depths.n, &f->measures, err);
}
