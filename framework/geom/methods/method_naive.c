/* Method "naive": the distance of every voxel to every triangle by brute force. Each row of voxels
 * is one part of the parallel loop, so a run can be cancelled and reports progress. */
#include "method.h"
#include "sdm/internal/brute_force.h"

static void naive_map_row(void *job, int64_t row, int thread)
{
    const sdm_run *run = job;
    const int64_t nx = run->grid->n[0], ny = run->grid->n[1];
    (void)thread;
    for (int64_t i = 0; i < nx; i++) {
        const double index[3] = {(double)i, (double)(row % ny), (double)(row / ny)};
        double x[3];
        sdm_grid_world(run->grid, index, x);
        run->values[row * nx + i] = (float)sdm_naive_point(run->mesh, x);
    }
}

static sdm_status naive_map(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts,
                            float *values, sdm_method_report *report, sdm_error *err)
{
    sdm_run run;
    sdm_status s = sdm_run_begin_plain(&run, mesh, grid, opts, values, err);
    if (!s) s = sdm_mesh_audit(mesh, &run.report.exact.audit, err);
    if (s) return sdm_run_end(&run, report, s);
    run.report.exact.sign = SDM_SIGN_WINDING;
    run.report.exact.n_tri_used = mesh->n_tri;
    sdm_run_prepared(&run);
    return sdm_run_end(
        &run, report, sdm_run_parts(&run, grid->n[1] * grid->n[2], naive_map_row, &run, 0, 1, err));
}

const sdm_method sdm_method_naive = {"naive",
                                     "every voxel against every triangle, all surface counted",
                                     "sign: Jacobson et al. 2013", true, naive_map};
