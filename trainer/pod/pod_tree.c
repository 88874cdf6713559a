/* Finds the blocks, voxels and coefficients that belong to a tree of blocks. */
#include "pod_tree.h"

pod_tree trainer_pod_tree(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t root)
{
    size_t level = levels->n - 1;
    pod_tree tree = {0};
    tree.first[level] = root;
    tree.end[level] = root + 1;
    for (; level > 0; level--) {
        const sdm_pod_block *last = &blocks[tree.end[level] - 1];
        tree.first[level - 1] = blocks[tree.first[level]].child;
        tree.end[level - 1] = last->child + last->n_children;
    }
    for (size_t b = tree.first[0]; b < tree.end[0]; b++) {
        const size_t voxels = sdm_pod_block_voxels(&blocks[b]);
        tree.voxels += voxels;
        if (voxels > tree.largest) tree.largest = voxels;
    }
    return tree;
}

size_t trainer_pod_tree_coefficients(const sdm_pod_block *blocks, const pod_tree *tree,
                                     size_t level)
{
    const sdm_pod_block *last = &blocks[tree->end[level] - 1];
    return last->coefficient + last->rank - blocks[tree->first[level]].coefficient;
}
