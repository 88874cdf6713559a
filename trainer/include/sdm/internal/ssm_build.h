/* Makes a statistical shape model of corresponding meshes: warps of a surface, alignment and
 * principal components. */
#pragma once

#include <stdbool.h>

#include "sdm/internal/ssm.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Moves the shapes vert[n][n_vert][3] onto their common mean: generalised Procrustes analysis
   (Gower 1975) with rotations by quaternions (Horn 1987) and, if asked, scaling to the mean
   centroid size. The pose of the first shape is kept. mean[n_vert][3]: the mean of the aligned
   shapes. One thread. SDM_E_ARG: fewer than two shapes, or a shape without extent; SDM_E_NOMEM. */
sdm_status sdm_ssm_align(size_t n, size_t n_vert, bool scale, double *vert, double *mean,
                         sdm_error *err);

/* out->mean, modes, variance, n_vert, n_modes and total = the principal components of the aligned
   shapes vert[n][n_vert][3], whose mean is mean[n_vert][3], by the eigenvectors of their Gram
   matrix (Sirovich 1987): at most n - 1 modes, those with a variance above 1e-10 of the largest.
   vert holds deviations from the mean afterwards. *out must be empty; sdm_ssm_dispose() frees it.
   SDM_E_ARG: all shapes are equal; SDM_E_NOMEM. */
sdm_status sdm_ssm_components(size_t n, size_t n_vert, double *vert, const double *mean,
                              sdm_ssm *out, sdm_error *err);

/* The most points of sdm_ssm_warp(): it needs a matrix of their square. */
#define SDM_SSM_WARP_MAX 8192

/* out[n][n_vert][3] = vert[n_vert][3], warped so that the points from[n_point][3] move onto
   to[k][n_point][3] in shape k: thin-plate splines in space (Duchon 1977; Bookstein 1989), the sum
   of a linear map and of weights of the distances from the points. Linear maps of the points are
   reproduced everywhere. One thread. SDM_E_ARG: fewer than 4 points, more than SDM_SSM_WARP_MAX,
   two at the same place, all in one plane; SDM_E_NOMEM. */
sdm_status sdm_ssm_warp(size_t n_point, const double *from, size_t n, const double *to,
                        size_t n_vert, const double *vert, double *out, sdm_error *err);

#ifdef __cplusplus
}
#endif
