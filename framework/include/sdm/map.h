/* Operations on any distance map, whether exact or computed by a network. */
#ifndef SDM_MAP_H
#define SDM_MAP_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* gradient[3][nz][ny][nx] = derivatives of values[nz][ny][nx] along the world axes x, y, z (LPS),
   for any orientation of the grid. The gradient has length 1 where the map is a distance; that of
   a network's map has about this length only, so divide it by its length for a normal. Finite
   differences of second order with spacing h: central, (f(i+1) - f(i-1)) / 2h; at the border
   one-sided, (-3 f(0) + 4 f(1) - f(2)) / 2h. On an axis of two voxels the differences are of first
   order, on an axis of one voxel they are 0. On the medial axis, where the nearest surface point
   jumps, the result lies between the gradients of both sides and is shorter than 1. n_threads 0:
   the OpenMP default; the same bits for every value. SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_map_gradient(const sdm_grid *grid, const float *values, int n_threads,
                                    float *gradient, sdm_error *err);

/* *volume = volume (mm^3) of the shape of a signed distance map values[nz][ny][nx]: the sum over
   the voxels of the volume of a voxel times 1 - H(distance), where the step H is smoothed over 1.5
   voxels (of the longest edge) on either side of the surface by a kernel whose second moment is 0
   (moment conditions: Tornberg and Engquist 2004). The volumes between the surface and those at
   a distance from it, cubic in this distance (Steiner 1840), then cancel: the error is about 0.02 %
   for a ball with a radius of ten voxels, where counting the voxels inside errs by 0.6 % and
   tetrahedra by 0.5 %; where the shape is thinner than three voxels, a few per cent. Only volume
   inside the box of the grid counts. n_threads 0: the OpenMP default; the same bits for every
   value. Of a network's map the volume has the error of the network, too:
   sdm_model_check_use(SDM_USE_VOLUME) tells whether it is at most 2 %. SDM_E_ARG: also a map with
   NaN; SDM_E_NOMEM. [any thread] */
SDM_API sdm_status sdm_map_volume(const sdm_grid *grid, const float *values, int n_threads,
                                  double *volume, sdm_error *err);

/* adjoint[nz][ny][nx] = derivatives of the volume of sdm_map_volume() by the values, mm^3 per mm.
   sdm_generate_vjp() makes derivatives of the volume by the parameters of them;
   sdm_model_check_use(SDM_USE_VOLUME_DERIVATIVE) tells whether those are right within 20 %.
   n_threads as above.
   adjoint may be the same array as values. SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_map_volume_adjoint(const sdm_grid *grid, const float *values, int n_threads,
                                          float *adjoint, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
