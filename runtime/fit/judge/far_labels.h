/* Labels that contradict the shape away from its surface, where labels and maps do not err. A small
 * part that the data have and the shape lacks, or the other way round, is a small share of the
 * volume, but its voxels lie together. */
#pragma once

#include "fit/solver/problem.h"

/* Voxels that contradict the shape, [0]: with the label, outside of the shape; [1]: without it,
 * inside. */
typedef struct fit_far_labels {
    double voxels[2]; /* 0: none, or no more than stray ones */
    double share[2];  /* their volume over that of the shape */
    double limit;     /* the share from which on they are no stray ones */
    double depth[2];  /* largest distance of such a sample from the surface, mm */
} fit_far_labels;

/* Counts the samples of a label map. beyond: number of voxels with the label that are too far away
 * to be samples. Stray voxels: fewer than 8, or than 0.2 % of the volume of the shape. */
fit_far_labels sdm_fit_far_labels(const fit_problem *p, double beyond);
