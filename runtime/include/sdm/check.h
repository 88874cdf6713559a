/* Check of a distance map: its error at voxels near the exact surface. */
#ifndef SDM_CHECK_H
#define SDM_CHECK_H

#include "sdm/exact.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_CHECK_POINTS 1000

/* Error = value of the map minus exact distance, mm, at the voxels nearest to SDM_CHECK_POINTS
   points spread evenly over the exact surface. These voxels lie within about half a voxel of the
   surface and decide where the zero surface of the map is. Nothing is interpolated, so an exact map
   has rounding errors only. The check is a sample: the largest error over all voxels is somewhat
   larger than max_mm, and the check does not find a false surface far from the exact one. All
   errors are NaN if used == 0. */
typedef struct sdm_check {
    /* abs(error): mean, root mean square, 95 % quantile (nearest rank), largest. */
    double mean_mm, rmse_mm, q95_mm, max_mm;
    double bias_mm; /* mean error; > 0: the map's surface lies inside the exact one */
    size_t used;    /* points inside the grid */
    size_t outside; /* points outside the grid, not checked */
} sdm_check;

/* A statistic of the error, for sdm_generate_opts.max_error_of. */
typedef enum sdm_check_stat {
    SDM_CHECK_MAX = 0,
    SDM_CHECK_Q95 = 1,
    SDM_CHECK_RMSE = 2,
    SDM_CHECK_MEAN = 3
} sdm_check_stat;

/* The value of a statistic, mm; NaN for an unknown statistic. */
SDM_API double sdm_check_get(const sdm_check *c, sdm_check_stat stat);

/* The name of a statistic: "max", "q95", "rmse" or "mean"; "unknown" for an unknown statistic. */
SDM_API const char *sdm_check_stat_name(sdm_check_stat stat);

/* Checks values[nz][ny][nx] against the surface of `engine`. The points are the same for the same
   surface. SDM_E_ARG, SDM_E_NOMEM. [any thread] */
SDM_API sdm_status sdm_check_map(const sdm_exact *engine, const sdm_grid *grid, const float *values,
                                 sdm_check *out, sdm_error *err);

/* Checks values[nz][ny][nx] against a shape at p[n_params]. Most of the time is spent on building
   the mesh and the engine, however small the grid is. Also returns the errors of
   sdm_instance_mesh() and sdm_exact_create(). [any thread] */
SDM_API sdm_status sdm_check_shape(const sdm_instance *shape, const double *p, const sdm_grid *grid,
                                   const float *values, sdm_check *out, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
