/* Spaces of an image that look like the inside of the shape but are wider than it. */
#ifndef FIT_CAVITY_H
#define FIT_CAVITY_H

#include "sdm/fit.h"

/* *values: copy of the image of target (caller frees with sdm_free()), NaN in the spaces that hold
   a ball of opts->cavity mm; *count: voxels made NaN. A voxel counts as such a space where its
   value, seen through opts->blur, is more likely inside than outside by opts->appearance. What lies
   beyond the image is no wall. The same bits for any number of threads. */
sdm_status sdm_fit_leave_out_cavities(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                      float **values, size_t *count, sdm_error *err);

#endif
