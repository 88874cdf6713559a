/* What training makes small: the error of every voxel by train.loss, and by train.eikonal how far
 * the slope of the map is from 1. */
#ifndef SDM_TRAINER_LOSS_H
#define SDM_TRAINER_LOSS_H

#include "sdm/internal/config.h"

/* Slope of the loss of one value with respect to it: train.loss, weighted near the surface
   (train.near_weight). The squared error, mm^2, is added to *square: progress is told as mean
   square error whatever the loss. */
float loss_slope(const sdm_config *c, float predicted, float target, double *square);

/* The same without the weight near the surface, for voxels that were drawn by that weight. */
float loss_slope_drawn(const sdm_config *c, float predicted, float target, double *square);

/* Eikonal term of one voxel (Gropp et al. 2020): train.eikonal * (|g| - 1)^2 with g[i] = (f[1 + i]
   - f[0]) / spacing[i], i < 3; f[0] is the value at the voxel, f[1 + i] at its neighbour along axis
   i. slope[4] is added to: share times its derivative by f. Returns the term. */
double loss_eikonal(const sdm_config *c, const float f[4], float share, float slope[4]);

/* A whole map: slope[nz][ny][nx], overwritten, of the mean over the voxels of the loss and of the
   eikonal term (where all three neighbours exist) with respect to predicted[nz][ny][nx]. Returns
   the sum of the squared errors, mm^2. */
double loss_map(const sdm_config *c, const float *predicted, const float *target, float *slope);

#endif
