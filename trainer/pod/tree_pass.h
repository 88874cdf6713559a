/* Passes through a tree (pod_tree.h): from the coefficients of its root to the voxels, and back. B
   is the number of maps; other letters as in pod_state.h. */
#pragma once

#include "pod_state.h"
#include "pod_tree.h"

/* The arrays of a tree, most of them in scratch memory. */
typedef struct tree_work {
    pod_tree tree;
    size_t ld[SDM_POD_MAX_LEVELS]; // row length on each level
    float *c[SDM_POD_MAX_LEVELS];  // [B][ld] coefficients
    float *dc[SDM_POD_MAX_LEVELS]; // [B][ld] gradients by the coefficients
    float *predicted, *delta;      // [B][voxels] map, and gradient with respect to the map
    float *basis_gradient;         // [k_b][V_b] of one block
} tree_work;

/* Floats of scratch memory for one tree and `rows` maps: predicted voxels, coefficients below the
   highest level, the gradients with respect to both, and the gradient of the largest basis. */
size_t trainer_tree_floats(const pod_state *pod, size_t rows, size_t root);

/* The arrays of the tree below block `root` for `rows` maps: scratch[trainer_tree_floats()];
   c[rows][K] and dc[rows][K] are the coefficients of the highest level and the gradients by them.
 */
tree_work trainer_tree_work(const pod_state *pod, size_t rows, size_t root, float *scratch,
                            float *c, float *dc);

/* Where a block's coefficients and outputs begin within the rows of its tree, and the number of
   outputs. */
typedef struct block_place {
    size_t coefficient, output, outputs;
} block_place;

block_place trainer_tree_place(const pod_state *pod, const tree_work *w, size_t level, size_t b);

/* Computes w->predicted[rows][voxels] from the coefficients of the highest level, with mean map and
   bases from `weights`, laid out as pod->refine. */
void trainer_tree_forward(const pod_state *pod, const float *weights, size_t rows,
                          const tree_work *w);

/* Carries the gradient of block b of `level` from its outputs (voxels: w->delta) to its
   coefficients. Call it for the blocks of one level after the other, from the lowest. */
void trainer_tree_back(const pod_state *pod, const float *weights, size_t rows, const tree_work *w,
                       size_t level, size_t b);
