/* Cavities: spaces of an image that look like the inside of the shape but are wider than it. */
#ifndef FIT_CAVITY_H
#define FIT_CAVITY_H

#include "sdm/fit.h"

/* *values[nz][ny][nx]: copy of the target's image (the caller frees it with sdm_free()), with NaN
   in every space that holds a ball of radius opts->cavity (mm); *count: voxels set to NaN. A voxel
   belongs to such a space where its value, smoothed by opts->blur, is more likely inside than
   outside by opts->appearance (as Gaussians). The border of the image is no wall: balls may reach
   beyond it. SDM_E_ARG: blur too wide for the grid. The same bits for any number of threads. */
sdm_status sdm_fit_mask_cavities(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                 float **values, size_t *count, sdm_error *err);

#endif
