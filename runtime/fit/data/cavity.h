/* Cavities: spaces of an image that look like the inside of the shape but are wider than it. */
#pragma once

#include "sdm/fit.h"

/* *values[nz][ny][nx]: copy of the target's image (the caller frees it with sdm_free()), with NaN
   at every voxel covered by a ball of radius opts->cavity (mm) that fits into inside-like space;
   *count: number of voxels set to NaN; *widest: radius of the widest such ball, mm. A voxel is
   inside-like where its value, smoothed by a Gaussian of sd opts->blur (mm), is more likely inside
   than outside by opts->appearance (all tissues as Gaussians). The border of the image is no wall:
   balls may reach beyond it. SDM_E_ARG: blur too wide for the grid. The same bits for any number of
   threads. */
sdm_status sdm_fit_mask_cavities(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                 float **values, size_t *count, double *widest, sdm_error *err);
