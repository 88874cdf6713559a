/* Method "exact": calls the exact engine (sdm/exact.h). */
#include "method.h"

static sdm_status exact_map(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts,
                            float *values, sdm_method_report *report, sdm_error *err)
{
    sdm_run run;
    sdm_status s = sdm_run_begin(&run, mesh, grid, opts, values, err);
    const sdm_exact_layers layers = {.values = values, .band_mm = opts ? opts->band_mm : 0};
    if (!s) s = sdm_exact_map_layers(run.engine, grid, &layers, err);
    return sdm_run_end(&run, report, s);
}

const sdm_method sdm_method_exact = {
    "exact", "the exact engine: candidate features shared by blocks of voxels", "sdm/exact.h", true,
    exact_map};
