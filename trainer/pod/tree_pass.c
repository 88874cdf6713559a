/* Passes through a tree of blocks. */
#include "tree_pass.h"

#include <string.h>

#include "sdm/internal/kernels.h"

size_t trainer_tree_floats(const pod_state *pod, size_t rows, size_t root)
{
    const pod_tree tree = trainer_pod_tree(&pod->arch.levels, pod->blocks, root);
    size_t each = tree.voxels, largest = tree.largest;
    for (size_t level = 0; level + 1 < pod->arch.levels.n; level++)
        each += trainer_pod_tree_coefficients(pod->blocks, &tree, level);
    for (size_t level = 0; level < pod->arch.levels.n; level++)
        for (size_t b = tree.first[level]; b < tree.end[level]; b++) {
            const size_t matrix = pod->matrix_at[b + 1] - pod->matrix_at[b];
            if (matrix > largest) largest = matrix;
        }
    return 2 * rows * each + largest;
}

tree_work trainer_tree_work(const pod_state *pod, size_t rows, size_t root, float *scratch,
                            float *c, float *dc)
{
    tree_work w = {.tree = trainer_pod_tree(&pod->arch.levels, pod->blocks, root)};
    const size_t top = pod->arch.levels.n - 1;
    float *at = scratch;
    for (size_t level = 0; level < top; level++) {
        w.ld[level] = trainer_pod_tree_coefficients(pod->blocks, &w.tree, level);
        w.c[level] = at, at += rows * w.ld[level];
        w.dc[level] = at, at += rows * w.ld[level];
    }
    w.ld[top] = pod->arch.n_coefficients;
    w.c[top] = c + pod->blocks[root].coefficient;
    w.dc[top] = dc + pod->blocks[root].coefficient;
    w.predicted = at, at += rows * w.tree.voxels;
    w.delta = at, at += rows * w.tree.voxels;
    w.basis_gradient = at;
    return w;
}

block_place trainer_tree_place(const pod_state *pod, const tree_work *w, size_t level, size_t b)
{
    const sdm_pod_block *k = &pod->blocks[b];
    const size_t lowest = w->tree.first[0];
    return (block_place){k->coefficient - pod->blocks[w->tree.first[level]].coefficient,
                         level ? pod->blocks[k->child].coefficient -
                                     pod->blocks[w->tree.first[level - 1]].coefficient
                               : (size_t)(k->voxel - pod->blocks[lowest].voxel),
                         sdm_pod_outputs(pod->blocks, b)};
}

void trainer_tree_forward(const pod_state *pod, const float *weights, size_t rows,
                          const tree_work *w)
{
    const float *mean = weights + pod->mean_at + pod->blocks[w->tree.first[0]].voxel;
    for (size_t r = 0; r < rows; r++)
        memcpy(w->predicted + r * w->tree.voxels, mean, w->tree.voxels * sizeof *mean);
    for (size_t level = pod->arch.levels.n; level-- > 0;)
        for (size_t b = w->tree.first[level]; b < w->tree.end[level]; b++) {
            const block_place p = trainer_tree_place(pod, w, level, b);
            float *to = level ? w->c[level - 1] : w->predicted;
            const size_t ldt = level ? w->ld[level - 1] : w->tree.voxels;
            sdm_gemm(rows, p.outputs, pod->blocks[b].rank,
                     (sdm_view){w->c[level] + p.coefficient, w->ld[level], 1},
                     (sdm_view){weights + pod->basis_at + pod->matrix_at[b], p.outputs, 1},
                     level == 0, to + p.output, ldt, 1);
        }
}

void trainer_tree_back(const pod_state *pod, const float *weights, size_t rows, const tree_work *w,
                       size_t level, size_t b)
{
    const block_place p = trainer_tree_place(pod, w, level, b);
    const float *from = (level ? w->dc[level - 1] : w->delta) + p.output;
    sdm_gemm(rows, pod->blocks[b].rank, p.outputs,
             (sdm_view){from, level ? w->ld[level - 1] : w->tree.voxels, 1},
             (sdm_view){weights + pod->basis_at + pod->matrix_at[b], 1, p.outputs}, false,
             w->dc[level] + p.coefficient, w->ld[level], 1);
}
