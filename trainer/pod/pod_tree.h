/* A block of the highest level with everything below it: a tree that can be worked on alone. */
#ifndef SDM_POD_TREE_H
#define SDM_POD_TREE_H

#include "sdm/internal/pod.h"

typedef struct pod_tree {
    size_t first[SDM_POD_MAX_LEVELS],
        end[SDM_POD_MAX_LEVELS]; /* blocks of each level: first .. end - 1 */
    size_t largest;              /* voxels of the largest block of the lowest level */
    size_t voxels;               /* of all; they are neighbours in block order */
} pod_tree;

pod_tree pod_tree_of(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t root);

/* Number of coefficients of the tree's blocks of a level, which are neighbours; after
 * sdm_pod_number(). */
size_t pod_tree_coefficients(const sdm_pod_block *blocks, const pod_tree *tree, size_t level);

#endif
