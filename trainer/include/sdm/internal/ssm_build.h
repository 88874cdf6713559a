/* Makes a statistical shape model of corresponding meshes: alignment and principal components. */
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

#ifdef __cplusplus
}
#endif
