/* Softens a label map, so that it looks as if it were seen through a point spread. */
#pragma once

#include "sdm/grid.h"

/* out[grid] = values[grid], 0 .. 1, convolved with a Gaussian of standard deviation sd (mm, at most
 * 32 of the smallest voxel spacing count). NaN stays NaN and is left out of the averages. n_threads
 * >= 1; the bits of the result do not depend on it. SDM_E_NOMEM. */
sdm_status sdm_fit_soften_labels(const sdm_grid *grid, const float *values, double sd,
                                 int n_threads, float *out, sdm_error *err);
