/* Softens a label map, so that it looks as if it were seen through a point spread. */
#pragma once

#include "sdm/fit.h"

/* out[grid] = values[grid], 0 .. 1, convolved with a Gaussian of standard deviation sd (mm, at most
 * 32 of the smallest voxel spacing count). NaN stays NaN and is left out of the averages. n_threads
 * >= 1; the bits of the result do not depend on it. SDM_E_NOMEM. */
sdm_status sdm_fit_soften_labels(const sdm_grid *grid, const float *values, double sd,
                                 int n_threads, float *out, sdm_error *err);

/* Presents a label map as an image with the value 1 inside and 0 outside, with fixed tissues, seen
   through a point spread as wide as the maps of `source` can represent: changes *target and *opts.
   *values: memory of the image, for sdm_free(), also on error. */
sdm_status sdm_fit_labels_as_image(const sdm_fit_source *source, sdm_fit_target *target,
                                   sdm_fit_opts *opts, float **values, sdm_error *err);
