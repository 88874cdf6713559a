/* Steps of labels that err together.

   The round wall of a rod along an axis of the voxels touches their layers on four sides. If its
   axis runs through the middle of a voxel, or between two, all four sides lie at the same part of a
   voxel: their errors are the same, and so they do not average out in the radius. */
#pragma once

#include <stddef.h>

/* A piece of a curved surface that is nearly parallel to the planes of voxels. */
typedef struct fit_matching_step {
    /* place of the surface within a voxel, counted outwards, in turns: 1 is one voxel */
    double place;
    /* sd of the place (mm), and the information about it */
    double sd, weight;
    /* [n_unknowns] score caused by an error of 1 mm of the place */
    const double *score;
} fit_matching_step;

/* The errors of pieces that lie at the same part of a voxel are equal, so the score varies more
 * than if they were independent. Adds this difference to its covariance out[n][n]. work[n + count]:
 * scratch memory. */
void sdm_fit_matching_steps(const fit_matching_step *list, size_t count, size_t n, double *work,
                            double *out);
