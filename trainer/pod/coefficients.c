/* Projects maps on the local bases, level by level. */
#include "coefficients.h"

#include <stdatomic.h>

#include "pod_ranks.h"
#include "pod_tree.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"
#include "state/progress.h"

void trainer_coefficients_block_rows(const pod_state *pod, const sdm_pod_block *b, bool holdout,
                                     const size_t *slots, size_t n, float *rows)
{
    enum { AHEAD = 16, LINE = 64 / sizeof(int16_t) }; // maps; voxels of a cache line
    const dataset *d = &pod->t->data;
    const size_t voxels = sdm_pod_block_voxels(b);
    const float *mean = pod->mean + b->voxel;
    for (size_t i = 0; i < n; i++) {
        // a block has a few lines of each map: the processor does not foresee the next ones
        if (i + AHEAD < n && !holdout) {
            const int16_t *next = trainer_dataset_values(d, slots[i + AHEAD], b->voxel);
            for (size_t v = 0; v < voxels; v += LINE) __builtin_prefetch(next + v);
        }
        if (holdout) {
            const float *from = d->holdout + slots[i] * d->n_voxels + b->voxel;
            for (size_t v = 0; v < voxels; v++) rows[i * voxels + v] = from[v] - mean[v];
        } else {
            const int16_t *from = trainer_dataset_values(d, slots[i], b->voxel);
            const float scale = d->scale[slots[i]];
            for (size_t v = 0; v < voxels; v++)
                rows[i * voxels + v] = scale * (float)from[v] - mean[v];
        }
    }
}

void trainer_coefficients_project_block(size_t n, size_t rank, size_t outputs, const float *basis,
                                        const float *from, size_t ldf, float *to, size_t ldt)
{
    sdm_gemm(n, rank, outputs, (sdm_view){from, ldf, 1}, (sdm_view){basis, 1, outputs}, false, to,
             ldt, 1);
}

/* y[n][K]: fills the coefficients of the tree's root for the maps in slots[n]. rows, below and here
   are scratch memory; below and here hold the coefficients of two levels in turn. */
static void tree_project(const pod_state *pod, const pod_tree *tree, bool holdout,
                         const size_t *slots, size_t n, float *rows, float *below, float *here,
                         float *y)
{
    const size_t k = pod->arch.n_coefficients, top = pod->arch.levels.n - 1;
    size_t ldb = 0;
    for (size_t level = 0; level <= top; level++) {
        const uint32_t first = pod->blocks[tree->first[level]].coefficient;
        const size_t ldh =
            level == top ? k : trainer_pod_tree_coefficients(pod->blocks, tree, level);
        float *const to = level == top ? y + first : here;
        for (size_t b = tree->first[level]; b < tree->end[level]; b++) {
            const sdm_pod_block *block = &pod->blocks[b];
            const size_t outputs = sdm_pod_outputs(pod->blocks, b);
            const float *from = rows;
            if (level == 0)
                trainer_coefficients_block_rows(pod, block, holdout, slots, n, rows);
            else
                from = below + (pod->blocks[block->child].coefficient -
                                pod->blocks[tree->first[level - 1]].coefficient);
            trainer_coefficients_project_block(
                n, block->rank, outputs, pod->basis + pod->matrix_at[b], from,
                level ? ldb : outputs, to + (block->coefficient - first), ldh);
        }
        float *const swap = below;
        below = here, here = swap, ldb = ldh;
    }
}

/* A projection: the arguments of trainer_coefficients_project(). */
typedef struct projection {
    const pod_state *pod;
    bool holdout;
    const size_t *slots;
    size_t n;
    float *y;
    size_t first; // tree of this rank
    atomic_bool short_of_memory;
} projection;

/* Projects the maps on tree number `index` of this rank; maps in chunks, to limit the scratch
 * memory. */
static void project_tree(void *user, size_t index, int member)
{
    enum { CHUNK = 256 };
    projection *p = user;
    const pod_state *pod = p->pod;
    const sdm_pod_levels *levels = &pod->arch.levels;
    const size_t n = p->n, chunk = n < CHUNK ? n : CHUNK;
    const pod_tree tree =
        trainer_pod_tree(levels, pod->blocks, levels->first[levels->n - 1] + p->first + index);
    const size_t widest = trainer_pod_tree_coefficients(pod->blocks, &tree, 0);
    float *rows = NULL, *below = NULL, *here = NULL;
    (void)member;
    sdm_status s = SDM_ALLOC(&rows, chunk * tree.largest, "local coefficients", NULL);
    if (!s) s = SDM_ALLOC(&below, chunk * widest, "local coefficients", NULL);
    if (!s) s = SDM_ALLOC(&here, chunk * widest, "local coefficients", NULL);
    for (size_t at = 0; at < n && !s; at += CHUNK)
        tree_project(pod, &tree, p->holdout, p->slots + at, n - at < CHUNK ? n - at : CHUNK, rows,
                     below, here, p->y + at * pod->arch.n_coefficients);
    sdm_free(here);
    sdm_free(below);
    sdm_free(rows);
    if (s) atomic_store(&p->short_of_memory, true);
}

sdm_status trainer_coefficients_project(const pod_state *pod, bool holdout, const size_t *slots,
                                        size_t n, float *y, sdm_error *err)
{
    const pod_share share = trainer_pod_share(pod);
    projection p = {
        .pod = pod, .holdout = holdout, .slots = slots, .n = n, .y = y, .first = share.first};
    sdm_team_run(trainer_threads(pod->t), share.end - share.first, project_tree, &p);
    return atomic_load(&p.short_of_memory)
               ? sdm_fail(err, SDM_E_NOMEM, "no memory for local coefficients")
               : trainer_pod_gather_columns(pod, n, y, err);
}
