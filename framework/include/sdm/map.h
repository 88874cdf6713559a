/* Operations on any distance map, whether exact or computed by a network. */
#ifndef SDM_MAP_H
#define SDM_MAP_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* gradient[3][nz][ny][nx] = derivatives of values[nz][ny][nx] along the world axes x, y, z (LPS),
   for any orientation of the grid. The gradient of a distance has length 1, that of a network's
   map only about 1: for a normal divide it by its length. On the medial axis, where the nearest
   surface point jumps, the result lies between the gradients of both sides and is shorter than 1.
   Method: differences of second order, (f(i+1) - f(i-1)) / 2h, at the border
   (-3 f(0) + 4 f(1) - f(2)) / 2h, with the spacing h; on an axis of two voxels of first order, on
   an axis of one voxel 0. n_threads 0: the OpenMP default; the same bits for every value.
   SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_map_gradient(const sdm_grid *grid, const float *values, int n_threads,
                                    float *gradient, sdm_error *err);

/* *volume = volume (mm^3), inside the box of the grid, of the shape of a signed distance map
   values[nz][ny][nx]. Error: about 0.02 % for a ball with a radius of ten voxels (counting the
   voxels inside: 0.6 %, tetrahedra: 0.5 %); a few per cent where the shape is thinner than three
   voxels. A network's map has the error of the network, too: sdm_model_check_use(SDM_USE_VOLUME)
   tells whether the volume is right within 2 %. Method: the sum over the voxels of the volume of a
   voxel times 1 - H(distance). The step H is smoothed over 1.5 voxels (of the longest edge) on
   either side of the surface, by a kernel whose second moment is 0 (Tornberg and Engquist 2004), so
   that the errors of both sides cancel. n_threads 0: the OpenMP default; the same bits for every
   value. SDM_E_ARG: also a map with NaN; SDM_E_NOMEM. [any thread] */
SDM_API sdm_status sdm_map_volume(const sdm_grid *grid, const float *values, int n_threads,
                                  double *volume, sdm_error *err);

/* adjoint[nz][ny][nx] = derivatives of the volume of sdm_map_volume() by the values, mm^3 per mm.
   sdm_generate_vjp() of them gives the derivatives of the volume by the parameters;
   sdm_model_check_use(SDM_USE_VOLUME_DERIVATIVE) tells whether these are right within 20 %. adjoint
   may be the same array as values. n_threads as above. SDM_E_ARG. [any thread] */
SDM_API sdm_status sdm_map_volume_adjoint(const sdm_grid *grid, const float *values, int n_threads,
                                          float *adjoint, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
