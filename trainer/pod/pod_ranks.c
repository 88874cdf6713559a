/* Finds the trees of each rank, and gathers arrays. */
#include "pod_ranks.h"

#include <string.h>

#include "pod_tree.h"
#include "sdm/memory.h"

static size_t n_trees(const pod_state *pod)
{
    const sdm_pod_levels *levels = &pod->arch.levels;
    return levels->first[levels->n] - levels->first[levels->n - 1];
}

size_t trainer_pod_first_block(const pod_state *pod, size_t level, size_t tree)
{
    const sdm_pod_levels *levels = &pod->arch.levels;
    if (tree == n_trees(pod)) return levels->first[level + 1];
    return trainer_pod_tree(levels, pod->blocks, levels->first[levels->n - 1] + tree).first[level];
}

size_t trainer_pod_place_block(const pod_state *pod, size_t b)
{
    (void)pod;
    return b;
}

size_t trainer_pod_place_root(const pod_state *pod, size_t b)
{
    return b - pod->arch.levels.first[pod->arch.levels.n - 1];
}

size_t trainer_pod_place_voxel(const pod_state *pod, size_t b)
{
    return b < pod->arch.levels.first[1] ? pod->blocks[b].voxel : pod->arch.n_voxels;
}

/* Number of voxels in the trees before number `tree`. */
static size_t first_voxel(const pod_state *pod, size_t tree)
{
    return trainer_pod_place_voxel(pod, trainer_pod_first_block(pod, 0, tree));
}

/* The first tree of `rank`. Trees at the end of the grid are smaller, so each rank has about the
 * same number of voxels: its first voxel is the one nearest to rank / size of all. */
static size_t first_tree(const pod_state *pod, int rank)
{
    const size_t n = n_trees(pod),
                 aim = sdm_comm_first(pod->t->hooks.comm, pod->arch.n_voxels, rank);
    size_t below = 0, above = n; // first_voxel(below) <= aim <= first_voxel(above)
    while (above - below > 1) {
        const size_t middle = (below + above) / 2;
        *(first_voxel(pod, middle) <= aim ? &below : &above) = middle;
    }
    return aim - first_voxel(pod, below) < first_voxel(pod, above) - aim ? below : above;
}

pod_share trainer_pod_share(const pod_state *pod)
{
    const int rank = sdm_comm_rank(pod->t->hooks.comm);
    return (pod_share){first_tree(pod, rank), first_tree(pod, rank + 1)};
}

void trainer_pod_shares(trainer *t, size_t *share)
{
    const pod_state pod = {
        .t = t, .blocks = t->blocks, .arch = {.levels = t->levels, .n_voxels = t->data.n_voxels}};
    for (int r = 0; r <= sdm_comm_size(t->hooks.comm); r++)
        share[r] = first_voxel(&pod, first_tree(&pod, r));
}

size_t trainer_pod_place_matrix(const pod_state *pod, size_t b) { return pod->matrix_at[b]; }

size_t trainer_pod_place_coefficient(const pod_state *pod, size_t b)
{
    return b < pod->arch.levels.first[pod->arch.levels.n] ? pod->blocks[b].coefficient
                                                          : pod->arch.n_coefficients;
}

/* at[ranks + 1] = the first element of each rank, times `bytes`. */
static void find_parts(const pod_state *pod, size_t level, pod_place *place, size_t bytes,
                       size_t *at)
{
    const sdm_comm *comm = pod->t->hooks.comm;
    for (int r = 0; r <= sdm_comm_size(comm); r++) {
        const size_t tree = first_tree(pod, r);
        at[r] = place(pod, trainer_pod_first_block(pod, level, tree)) * bytes;
    }
}

sdm_status trainer_pod_gather(const pod_state *pod, size_t level, pod_place *place, size_t bytes,
                              void *data, sdm_error *err)
{
    sdm_comm *comm = pod->t->hooks.comm;
    size_t *at = NULL;
    if (!comm) return SDM_OK;
    sdm_status s = SDM_ALLOC(&at, (size_t)sdm_comm_size(comm) + 1, "parts of the ranks", err);
    if (!s) {
        find_parts(pod, level, place, bytes, at);
        s = sdm_comm_gather(comm, data, at, err);
    }
    sdm_free(at);
    return s;
}

/* Copies the columns first .. end - 1 of y[n][K] to part[n][end - first], or back. */
static void copy_columns(size_t n, size_t k, size_t first, size_t end, float *y, float *part,
                         bool back)
{
    const size_t width = end - first;
    for (size_t i = 0; i < n; i++) {
        float *column = y + i * k + first, *packed = part + i * width;
        memcpy(back ? column : packed, back ? packed : column, width * sizeof *y);
    }
}

sdm_status trainer_pod_gather_columns(const pod_state *pod, size_t n, float *y, sdm_error *err)
{
    enum { CHUNK = 1024 }; // rows that are sent at a time
    sdm_comm *comm = pod->t->hooks.comm;
    const size_t k = pod->arch.n_coefficients, rows = n < CHUNK ? n : CHUNK,
                 ranks = (size_t)sdm_comm_size(comm), mine = (size_t)sdm_comm_rank(comm);
    float *packed = NULL;
    size_t *column = NULL, *at = NULL;
    if (!comm) return SDM_OK;
    sdm_status s = SDM_ALLOC(&packed, rows * k, "coefficients of the ranks", err);
    if (!s) s = SDM_ALLOC(&column, ranks + 1, "parts of the ranks", err);
    if (!s) s = SDM_ALLOC(&at, ranks + 1, "parts of the ranks", err);
    if (!s) find_parts(pod, pod->arch.levels.n - 1, trainer_pod_place_coefficient, 1, column);
    for (size_t from = 0; from < n && !s; from += CHUNK) {
        const size_t here = n - from < CHUNK ? n - from : CHUNK;
        float *part = y + from * k;
        for (size_t r = 0; r <= ranks; r++) at[r] = column[r] * here * sizeof *y;
        copy_columns(here, k, column[mine], column[mine + 1], part, packed + column[mine] * here,
                     false);
        s = sdm_comm_gather(comm, packed, at, err);
        for (size_t r = 0; r < ranks && !s; r++)
            if (r != mine)
                copy_columns(here, k, column[r], column[r + 1], part, packed + column[r] * here,
                             true);
    }
    sdm_free(at);
    sdm_free(column);
    sdm_free(packed);
    return s;
}
