/* A "tree": one block of the highest level with all blocks below it. Trees can be computed
 * independently of each other, so one thread computes one tree. */
#pragma once

#include "sdm/internal/pod.h"

typedef struct pod_tree {
    /* Blocks of each level: first .. end - 1. */
    size_t first[SDM_POD_MAX_LEVELS], end[SDM_POD_MAX_LEVELS];
    size_t largest; /* voxels of the largest block of the lowest level */
    size_t voxels;  /* number of voxels of the tree; contiguous in block order */
} pod_tree;

/* The tree below block `root` of the highest level. */
pod_tree trainer_pod_tree(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t root);

/* Number of coefficients of the tree's blocks of one level; they are contiguous. Call after
   sdm_pod_number(). */
size_t trainer_pod_tree_coefficients(const sdm_pod_block *blocks, const pod_tree *tree,
                                     size_t level);
