/* What can be asked of any distance map, whoever made it. */
#ifndef SDM_MAP_H
#define SDM_MAP_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* gradient[3][nz][ny][nx] = the derivatives of values[nz][ny][nx] along x, y, z of the world (LPS,
   whatever the grid's directions); of length 1 where the map is a distance. Differences of second
   order: central, (f(i+1) - f(i-1)) / 2h, at the border one-sided, (-3 f(0) + 4 f(1) - f(2)) / 2h;
   of first order on an axis of two voxels, 0 on an axis of one. Where the nearest surface point
   jumps (medial axis) they lie between the gradients of both sides and are shorter than 1.
   n_threads 0: the OpenMP default; the same bits for every value. SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_map_gradient(const sdm_grid *grid, const float *values, int n_threads,
                                    float *gradient, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
