/* Gaussian smoothing and the Laplacian of packed fields on a grid. */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"

/* sd of the widest Gaussian, in voxels */
#define FIT_BLUR_MAX 32.0

/* Returns SDM_E_ARG if sd (mm) exceeds FIT_BLUR_MAX times the smallest voxel spacing. `name` and
 * `value` (mm): the option that leads to this sd, for the message. */
sdm_status sdm_fit_blur_check(const sdm_grid *g, const char *name, double value, double sd,
                              sdm_error *err);

/* Convolves (*packed)[voxels][n_fields] with a discrete Gaussian of this variance (mm^2); the
   values of the border continue beyond it. splines: the results are used as coefficients of cubic
   B-splines, which add 1/3 voxel^2 of variance along each axis; this amount is subtracted from
   `variance`, and a negative difference sharpens. The result is in *packed; *spare is scratch
   memory of the same size, and the two pointers may be swapped. n_threads >= 1; the bits of the
   result do not depend on it. */
void sdm_fit_blur(const sdm_grid *g, size_t n_fields, double variance, bool splines, int n_threads,
                  double **packed, double **spare);

/* Sets the last field to scale * Laplacian (per mm^2) of the first field. With scale = sd of the
 * blur (mm) this is the derivative of the first field by that sd. */
void sdm_fit_laplacian(const sdm_grid *g, size_t n_fields, double scale, int n_threads,
                       double *packed);
