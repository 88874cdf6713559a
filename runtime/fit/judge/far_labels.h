/* Labels that contradict the shape away from its surface, where errors of the labels and of the
 * maps do not reach. A small part that the data have and the shape lacks, or the other way round,
 * is a small share of the volume, but one that lies together. */
#pragma once

#include "fit/solver/problem.h"

/* Voxels that contradict the shape, [0]: with the label, outside of the shape; [1]: without it,
 * inside. */
typedef struct fit_far_labels {
    double voxels[2];
    double depth[2]; /* largest distance of one of them from the surface, mm */
    double limit;    /* distance beyond which they count, mm */
} fit_far_labels;

/* Counts the samples of a label map. beyond: voxels with the label that are too far away to be
 * samples. */
fit_far_labels sdm_fit_far_labels(const fit_problem *p, double beyond);

/* Whether so many voxels are more than stray ones: 8, and a share of the volume of the shape. */
bool sdm_fit_far_labels_count(const fit_problem *p, double voxels);
