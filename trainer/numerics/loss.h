/* The loss of the training: an error term for every voxel (train.loss) and the eikonal term
   (train.eikonal), which penalises gradients of the map whose length is not 1. */
#pragma once

#include "sdm/internal/config.h"

/* Derivative of the error term of one voxel with respect to `predicted` (mm), including the weight
   1 + train.near_weight for abs(target) < train.near_mm. Adds the squared error (mm^2) to *square:
   progress is reported as mean square error for every choice of train.loss. */
float trainer_loss_slope(const sdm_config *c, float predicted, float target, double *square);

/* slope[n] = trainer_loss_slope() of n voxels; slope may be target. Returns the sum of the squared
 * errors. */
double trainer_loss_slopes(const sdm_config *c, size_t n, const float *predicted,
                           const float *target, float *slope);

/* As trainer_loss_slope(), but without the weight 1 + train.near_weight: for voxels drawn with a
 * probability proportional to that weight (point_draw.h). */
float trainer_loss_slope_drawn(const sdm_config *c, float predicted, float target, double *square);

/* Eikonal term of one voxel (Gropp et al. 2020), train.eikonal * (|g| - 1)^2 with the forward
   differences g[i] = (f[1 + i] - f[0]) / spacing[i], i < 3. f[0] is the value at the voxel, f[1 +
   i] the value at its next neighbour along axis i. Adds share * derivative by f to slope[4].
   Returns the term, without `share`. */
double trainer_loss_eikonal(const sdm_config *c, const float f[4], float share, float slope[4]);

/* slope[nz][ny][nx] = derivative of the map's loss with respect to predicted[nz][ny][nx]: the mean
   error term over all voxels plus the mean eikonal term over the voxels that have a next neighbour
   along all three axes. Returns the sum of squared errors over the map, mm^2. */
double trainer_loss_map(const sdm_config *c, const float *predicted, const float *target,
                        float *slope);
