/* Method "naive": every voxel against every triangle, slice by slice so that it can be stopped and shows where it is. */
#include "method.h"

static sdm_status map(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts, float *values,
                      sdm_method_report *report, sdm_error *err)
{
    sdm_run run;
    sdm_status s = sdm_run_begin_plain(&run, mesh, grid, opts, values, err);
    if (!s) s = sdm_mesh_audit(mesh, &run.report.exact.audit, err);
    if (s) return sdm_run_end(&run, report, s);
    run.report.exact.sign = SDM_SIGN_WINDING;
    run.report.exact.n_tri_used = mesh->n_tri;
    sdm_run_prepared(&run);
    const sdm_exact_opts *o = &run.opts.exact;
    const size_t stride = (size_t)(grid->n[0] * grid->n[1]);
    sdm_grid slice = *grid;
    slice.n[2] = 1;
    for (int64_t k = 0; k < grid->n[2] && !s; k++) {
        sdm_grid_world(grid, (const double[3]){0, 0, (double)k}, slice.origin);
        s = sdm_naive_map(mesh, &slice, o->n_threads, values + (size_t)k * stride, err);
        if (run.opts.progress) run.opts.progress(o->user, (double)(k + 1) / (double)grid->n[2]);
        if (!s && o->cancelled && o->cancelled(o->user)) s = sdm_fail(err, SDM_E_CANCELLED, "map stopped on request");
    }
    return sdm_run_end(&run, report, s);
}

const sdm_method sdm_method_naive = {"naive", "every voxel against every triangle, all surface counted",
                                     "sign: Jacobson et al. 2013", true, map};
