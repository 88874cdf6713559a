/* The results of a fit as 3D Slicer reads them. */
#include <math.h>

#include "fit_command.h"
#include "slicer/results_file.h"

static void add_verdict(cli_results *r, const sdm_fit_verdict *v)
{
    sdm_text reasons = {0};
    for (size_t i = 0; i < v->n_findings; i++)
        if (v->findings[i].grade)
            sdm_text_add(&reasons, "%s%s", reasons.size ? "; " : "", v->findings[i].text);
    cli_results_text(r, "verdict", cli_fit_grade_name(v->grade));
    cli_results_text(r, "reasons", reasons.data ? reasons.data : "");
    sdm_text_dispose(&reasons);
}

sdm_status cli_fit_write_results(const cli_fit *f, sdm_error *err)
{
    const sdm_fit_result *x = &f->result;
    cli_results r = {0};
    add_verdict(&r, &x->verdict);
    cli_results_params(&r, "parameters", f->params, f->n_params, x->params);
    cli_results_params(&r, "deviations", f->params, f->n_params, x->sd);
    cli_results_reals(&r, "rotation", x->pose.rotation, 3);
    cli_results_reals(&r, "translation", x->pose.translation, 3);
    cli_results_real(&r, "dice", f->overlap.measured ? f->overlap.dice : NAN);
    return cli_results_write(&r, f->args->returns, err);
}
