/* Operations on any distance map, whether exact or computed by a network. */
#ifndef SDM_MAP_H
#define SDM_MAP_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* gradient[3][nz][ny][nx] = derivatives of values[nz][ny][nx] along the world axes x, y, z (LPS),
   for any orientation of the grid. The gradient has length 1 where the map is a distance. Finite
   differences of second order with spacing h: central, (f(i+1) - f(i-1)) / 2h; at the border
   one-sided, (-3 f(0) + 4 f(1) - f(2)) / 2h. On an axis of two voxels the differences are of first
   order, on an axis of one voxel they are 0. On the medial axis, where the nearest surface point
   jumps, the result lies between the gradients of both sides and is shorter than 1. n_threads 0:
   the OpenMP default; the same bits for every value. SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_map_gradient(const sdm_grid *grid, const float *values, int n_threads,
                                    float *gradient, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
