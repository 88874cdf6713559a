/* Gaussian smoothing of packed fields on a grid. */
#ifndef FIT_BLUR_H
#define FIT_BLUR_H

#include <stdbool.h>

#include "sdm/grid.h"

/* Standard deviation of the widest Gaussian, in voxels. */
#define FIT_BLUR_MOST 32.0

/* SDM_E_ARG where a Gaussian of this sd (mm), which option `name` = value (mm) asks for, is wider
 * on this grid. */
sdm_status sdm_fit_blur_check(const sdm_grid *g, const char *name, double value, double sd,
                              sdm_error *err);

/* (*packed)[voxels][n_fields] through the discrete Gaussian of this variance (mm^2); the border
   repeats. splines: what comes out are coefficients of cubic B-splines, whose own spread, a third
   of a voxel^2, is part of the variance. *spare, of the same size, may change places with *packed.
   The same bits for any number of threads. */
void sdm_fit_blur(const sdm_grid *g, size_t n_fields, double variance, bool splines, int n_threads,
                  double **packed, double **spare);

/* The last field = scale * Laplacian of the first: the derivative by the sd of the blur, with scale
 * = that sd. */
void sdm_fit_laplacian(const sdm_grid *g, size_t n_fields, double scale, int n_threads,
                       double *packed);

#endif
