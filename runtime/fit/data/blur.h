/* Gaussian smoothing and the Laplacian of packed fields on a grid. */
#ifndef FIT_BLUR_H
#define FIT_BLUR_H

#include <stdbool.h>

#include "sdm/grid.h"

/* sd of the widest Gaussian, in voxels */
#define FIT_BLUR_MAX 32.0

/* SDM_E_ARG where sd (mm) exceeds FIT_BLUR_MAX voxels along the axis with the smallest ones. `name`
 * and `value` (mm): the option that leads to this sd, for the message. */
sdm_status sdm_fit_blur_check(const sdm_grid *g, const char *name, double value, double sd,
                              sdm_error *err);

/* Convolves (*packed)[voxels][n_fields] with a discrete Gaussian of this variance (mm^2); the
   values of the border continue beyond it. splines: the results are used as coefficients of cubic
   B-splines, which add 1/3 voxel^2 of variance along each axis; that much is subtracted, and a
   negative rest sharpens. *spare: scratch of the same size; the two pointers may be swapped.
   n_threads >= 1; the same bits for any number. */
void sdm_fit_blur(const sdm_grid *g, size_t n_fields, double variance, bool splines, int n_threads,
                  double **packed, double **spare);

/* Last field = scale * Laplacian of the first, per mm^2: with scale = sd of the blur (mm), the
 * derivative of the first field by that sd. */
void sdm_fit_laplacian(const sdm_grid *g, size_t n_fields, double scale, int n_threads,
                       double *packed);

#endif
