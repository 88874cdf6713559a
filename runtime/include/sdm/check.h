/* A-posteriori check of a distance map: its error at voxels near the true surface. */
#ifndef SDM_CHECK_H
#define SDM_CHECK_H

#include "sdm/exact.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_CHECK_POINTS 1000

/* Error = value of the map - exact distance, mm, at the voxels nearest to SDM_CHECK_POINTS points
   that are spread evenly over the true surface: within about half a voxel of it, where the zero
   surface of the map is decided. No interpolation is involved: an exact map has errors of rounding
   only. A sample: the largest error of all voxels is a little larger, and a surface of the map
   where the true one is far away is not seen. NaN when no voxel was used. */
typedef struct sdm_check {
    double mean_mm, rmse_mm, q95_mm,
        max_mm;     /* |error|: mean, root mean square, 95 % quantile (nearest rank), largest */
    double bias_mm; /* mean error; above 0: the map's surface lies inside the true one */
    size_t used;    /* points in voxels of the grid */
    size_t outside; /* points that are in none */
} sdm_check;

/* Which figure a bound is for. */
typedef enum sdm_check_stat {
    SDM_CHECK_MAX = 0,
    SDM_CHECK_Q95 = 1,
    SDM_CHECK_RMSE = 2,
    SDM_CHECK_MEAN = 3
} sdm_check_stat;

SDM_API double sdm_check_get(const sdm_check *c, sdm_check_stat stat); /* NaN for an unknown one */
SDM_API const char *sdm_check_stat_name(sdm_check_stat stat); /* "max", "q95", "rmse", "mean" */

/* Checks values[nz][ny][nx] against a prepared mesh. The same points for the same surface.
 * SDM_E_ARG, SDM_E_NOMEM. [any thread] */
SDM_API sdm_status sdm_check_map(const sdm_exact *engine, const sdm_grid *grid, const float *values,
                                 sdm_check *out, sdm_error *err);

/* The same for a shape at p[n_params]: makes mesh and engine, which is most of the time and does
   not depend on the grid. Errors of sdm_instance_mesh() and sdm_exact_create(), too. [any thread]
 */
SDM_API sdm_status sdm_check_shape(const sdm_instance *shape, const double *p, const sdm_grid *grid,
                                   const float *values, sdm_check *out, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
