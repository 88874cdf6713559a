/* Map of a fitted shape on a grid of the world, and the centroid of a shape. */
#include <string.h>

#include "fit/data/interpolate.h"
#include "fit/data/samples.h"
#include "fit_check.h"
#include "sdm/internal/threads.h"

// makes the map of the source at params[n_params]; NULL: at the default parameters
static sdm_status map_make(const sdm_fit_source *source, const double *params, int n_threads,
                           fit_maps *maps, sdm_error *err)
{
    size_t n;
    sdm_status s = sdm_fit_check_source(source, &n, err);
    const sdm_fit_opts o = {.n_threads = n_threads};
    double used[FIT_PARAMS_MAX];
    if (!s) s = sdm_fit_maps_create(source, false, &o, maps, err);
    for (size_t k = 0; k < n && !s; k++) {
        size_t ignored;
        used[k] = params          ? params[k]
                  : source->model ? sdm_model_get_info(source->model)->params[k].def
                                  : sdm_instance_params(source->shape, &ignored)[k].def;
    }
    return s ? s : sdm_fit_maps_make(maps, used, false, err);
}

sdm_status sdm_fit_map(const sdm_fit_source *source, const double *params, const sdm_pose *pose,
                       const sdm_grid *grid, int n_threads, float *values, sdm_error *err)
{
    if (!params || !pose || !grid || !values)
        return sdm_fail(err, SDM_E_ARG,
                        "map of a fit: parameters, pose, grid and values are needed");
    // the map in the shape's frame
    sdm_status s = sdm_pose_check(pose, err);
    if (!s) s = sdm_grid_check(grid, err);
    fit_maps maps = {0};
    if (!s) s = map_make(source, params, n_threads, &maps, err);
    if (!s) {
        // interpolate it at every voxel of the grid
        const fit_field f = sdm_fit_maps_distances(&maps);
        fit_state state;
        sdm_pose_matrix(pose, state.rotation);
        memcpy(state.translation, pose->translation, sizeof state.translation);
        n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(static) num_threads(n_threads)
        for (int64_t row = 0; row < grid->n[1] * grid->n[2]; row++)
            for (int64_t i = 0; i < grid->n[0]; i++) {
                // centre of the voxel in the world
                double x[3];
                sdm_grid_world(grid,
                               (const double[3]){(double)i, (double)(row % grid->n[1]),
                                                 (double)(row / grid->n[1])},
                               x);
                values[row * grid->n[0] + i] = (float)sdm_fit_field_at(&f, &state, x);
            }
    }
    sdm_fit_maps_dispose(&maps);
    return s;
}

sdm_status sdm_fit_centre(const sdm_fit_source *source, const double *params, double centre[3],
                          sdm_error *err)
{
    if (!centre) return sdm_fail(err, SDM_E_ARG, "centre of a shape: a place for it is needed");
    fit_maps maps = {0};
    fit_extent extent;
    sdm_status s = map_make(source, params, 0, &maps, err);
    if (!s) s = sdm_fit_extent(&maps, &extent, err);
    if (!s) memcpy(centre, extent.centre, sizeof extent.centre);
    sdm_fit_maps_dispose(&maps);
    return s;
}
