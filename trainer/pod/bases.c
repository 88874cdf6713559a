/* Computes the mean map and the nested local bases by proper orthogonal decomposition. The basis of
   a block consists of eigenvectors of a covariance: on the lowest level that of its voxels, above
   that of its children's coefficients. */
#include "bases.h"

#include <stdlib.h>
#include <string.h>

#include "coefficients.h"
#include "data/streams.h"
#include "numerics/linalg.h"
#include "pod_ranks.h"
#include "pod_tree.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "state/progress.h"

/* At most this many maps are used. With half as many the bases of the cochlea leave 1.2 % more
   error on unseen shapes, with twice as many no less. */
enum { BASES_MAPS = 4096 };

typedef struct candidate {
    double gain; // explained variance per weight
    uint32_t block;
} candidate;

static int compare_gains(const void *a, const void *b)
{
    const candidate *x = a, *y = b;
    if (x->gain != y->gain) return x->gain < y->gain ? 1 : -1;
    return x->block < y->block ? -1 : x->block > y->block;
}

/* The bases while they are computed. The gain of a basis function is the variance it explains,
   divided by the number of weights it costs: its own and those that produce its coefficient. On all
   levels the functions above the same gain are kept, so that the error is smallest for the total
   number of weights. */
typedef struct basis_work {
    pod_state *pod;
    size_t n, *slots; // slots of the n maps used
    size_t keep;      // largest number of functions of a lowest-level block
    pod_share share;  // the trees of this rank; it has the bases of their blocks alone
    float *lowest;    // [n_voxels][keep] eigenvectors on the lowest level, block after block
    double *values;   // [blocks of the lowest level][keep]
    double min_gain;
    float **basis; // [blocks] [k_b][V_b]
} basis_work;

/* Number of weights that produce one coefficient of a function of `level`: an estimate, since the
   ranks of the levels above are not known yet. */
static double cost_above(const pod_state *pod, size_t level)
{
    const double rank = pod->t->config->network.rank;
    if (level + 1 == pod->arch.levels.n) return (double)pod->arch.n_latent;
    return level ? 4 * rank : 2.5 * rank;
}

/* vectors[keep][outputs], values[keep] = leading eigenvectors and eigenvalues of the covariance of
   rows[n][stride], of which only the first `outputs` columns are used. covariance[outputs][outputs]
   is scratch memory. */
static sdm_status block_eigenvectors(const basis_work *m, size_t block, size_t n, const float *rows,
                                     size_t stride, size_t outputs, size_t keep, float *covariance,
                                     float *vectors, double *values, sdm_error *err)
{
    sdm_gemm(outputs, outputs, n, (sdm_view){rows, 1, stride}, (sdm_view){rows, stride, 1}, false,
             covariance, outputs, 1);
    for (size_t i = 0; i < outputs * outputs; i++) covariance[i] /= (float)n;
    return trainer_leading_eigenvectors(outputs, covariance, keep, m->pod->t->config->seed,
                                        STREAM_BASES + 1 + block, vectors, values, err);
}

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }

/* Number of functions computed for a block with `outputs` outputs; n maps determine at most n
 * functions. */
static size_t n_functions(const basis_work *m, size_t outputs)
{
    return min_size(m->keep, min_size(outputs, m->n));
}

/* Computes the mean map and the leading eigenvectors of block `index` of the lowest level. rows and
 * covariance are scratch memory. */
static sdm_status lowest_level_block(basis_work *m, size_t index, float *rows, float *covariance,
                                     sdm_error *err)
{
    pod_state *pod = m->pod;
    const sdm_pod_block *b = &pod->blocks[index];
    const size_t voxels = sdm_pod_block_voxels(b);
    float *mean = pod->mean + b->voxel;
    memset(mean, 0, voxels * sizeof *mean);
    trainer_coefficients_block_rows(pod, b, false, m->slots, m->n, rows);
    for (size_t v = 0; v < voxels; v++) {
        double sum = 0;
        for (size_t i = 0; i < m->n; i++) sum += rows[i * voxels + v];
        mean[v] = (float)(sum / (double)m->n);
    }
    for (size_t i = 0; i < m->n; i++)
        for (size_t v = 0; v < voxels; v++) rows[i * voxels + v] -= mean[v];
    return block_eigenvectors(m, index, m->n, rows, voxels, voxels, n_functions(m, voxels),
                              covariance, m->lowest + b->voxel * m->keep,
                              m->values + index * m->keep, err);
}

/* Chooses the ranks of the lowest level: one function in each block, then the functions with the
   largest gain until the average is network.rank per block. Sets min_gain to the gain of the last
   one. */
static sdm_status lowest_level_ranks(basis_work *m, sdm_error *err)
{
    pod_state *pod = m->pod;
    const size_t n_blocks = pod->arch.levels.first[1],
                 wanted = (size_t)pod->t->config->network.rank * n_blocks;
    candidate *c = NULL;
    size_t n = 0;
    sdm_status s = SDM_ALLOC(&c, n_blocks * m->keep, "basis candidates", err);
    // candidates: every function but the first of each block
    for (size_t b = 0; b < n_blocks && !s; b++) {
        const size_t voxels = sdm_pod_block_voxels(&pod->blocks[b]);
        pod->blocks[b].rank = 1;
        for (size_t i = 1; i < n_functions(m, voxels); i++)
            c[n++] = (candidate){m->values[b * m->keep + i] / ((double)voxels + cost_above(pod, 0)),
                                 (uint32_t)b};
    }
    if (!s) qsort(c, n, sizeof *c, compare_gains);
    for (size_t i = 0; i < n && i + n_blocks < wanted && !s; i++) {
        pod->blocks[c[i].block].rank++;
        m->min_gain = c[i].gain;
    }
    sdm_free(c);
    // copy the chosen functions
    const size_t end = trainer_pod_first_block(pod, 0, m->share.end);
    for (size_t b = trainer_pod_first_block(pod, 0, m->share.first); b < end && !s; b++) {
        const size_t size = pod->blocks[b].rank * sdm_pod_block_voxels(&pod->blocks[b]);
        if (!(s = SDM_ALLOC(&m->basis[b], size, "local bases", err)))
            memcpy(m->basis[b], m->lowest + pod->blocks[b].voxel * m->keep,
                   size * sizeof **m->basis);
    }
    // free the eigenvectors now: they take gigabytes on fine grids
    sdm_free(m->lowest);
    m->lowest = NULL;
    return s;
}

/* Sum of the ranks of blocks first .. end - 1. */
static size_t sum_ranks(const pod_state *pod, size_t first, size_t end)
{
    size_t n = 0;
    for (size_t b = first; b < end; b++) n += pod->blocks[b].rank;
    return n;
}

/* Computes the basis of block `index` of a level above the lowest. Row i of below[n][stride] begins
   with the coefficients of the block's children for map i of n. Keeps all basis functions whose
   gain (explained variance per weight) exceeds min_gain, and at least one. */
static sdm_status upper_level_block(basis_work *m, size_t level, size_t index, const float *below,
                                    size_t stride, sdm_error *err)
{
    sdm_pod_block *b = &m->pod->blocks[index];
    const size_t outputs = sum_ranks(m->pod, b->child, b->child + b->n_children);
    const size_t keep =
        min_size(16 * (size_t)m->pod->t->config->network.rank, min_size(outputs, m->n));
    float *covariance = NULL, *vectors = NULL;
    double *values = NULL;
    sdm_status s = SDM_ALLOC(&covariance, outputs * outputs, "local bases", err);
    if (!s) s = SDM_ALLOC(&vectors, keep * outputs, "local bases", err);
    if (!s) s = SDM_ALLOC(&values, keep, "local bases", err);
    if (!s)
        s = block_eigenvectors(m, index, m->n, below, stride, outputs, keep, covariance, vectors,
                               values, err);
    b->rank = 1;
    while (!s && b->rank < keep &&
           values[b->rank] > m->min_gain * ((double)outputs + cost_above(m->pod, level)))
        b->rank++;
    sdm_free(covariance);
    sdm_free(values);
    m->basis[index] = vectors;
    return s;
}

/* Computes the bases of all levels above the lowest in the tree below `root`. */
static sdm_status upper_levels_of_tree(basis_work *m, size_t root, sdm_error *err)
{
    const pod_state *pod = m->pod;
    const pod_tree tree = trainer_pod_tree(&pod->arch.levels, pod->blocks, root);
    float *rows = NULL, *below = NULL, *here = NULL;
    size_t ldb = sum_ranks(pod, tree.first[0], tree.end[0]), at = 0;
    sdm_status s = SDM_ALLOC(&rows, m->n * tree.largest, "local bases", err);
    if (!s) s = SDM_ALLOC(&below, m->n * ldb, "local coefficients", err);
    if (!s) s = SDM_ALLOC(&here, m->n * ldb, "local coefficients", err);
    // coefficients of the lowest level: below[n][ldb]
    for (size_t b = tree.first[0]; b < tree.end[0] && !s; b++) {
        const sdm_pod_block *k = &pod->blocks[b];
        const size_t voxels = sdm_pod_block_voxels(k);
        trainer_coefficients_block_rows(pod, k, false, m->slots, m->n, rows);
        trainer_coefficients_project_block(m->n, k->rank, voxels, m->basis[b], rows, voxels,
                                           below + at, ldb);
        at += k->rank;
    }
    // on each level: the bases from the coefficients of the level below, then the coefficients of
    // this level
    for (size_t level = 1; level < pod->arch.levels.n && !s; level++) {
        size_t child = 0;
        at = 0;
        for (size_t b = tree.first[level]; b < tree.end[level] && !s; b++) {
            s = upper_level_block(m, level, b, below + child, ldb, err);
            child += sum_ranks(pod, pod->blocks[b].child,
                               pod->blocks[b].child + pod->blocks[b].n_children);
        }
        // coefficients of this level
        const size_t ldh = sum_ranks(pod, tree.first[level], tree.end[level]);
        child = 0;
        for (size_t b = tree.first[level]; b < tree.end[level] && !s; b++) {
            const sdm_pod_block *k = &pod->blocks[b];
            const size_t outputs = sum_ranks(pod, k->child, k->child + k->n_children);
            trainer_coefficients_project_block(m->n, k->rank, outputs, m->basis[b], below + child,
                                               ldb, here + at, ldh);
            child += outputs, at += k->rank;
        }
        float *const swap = below;
        below = here, here = swap, ldb = ldh;
    }
    sdm_free(here);
    sdm_free(below);
    sdm_free(rows);
    return s;
}

/* The error with the lowest block number in a parallel loop, so that the message does not depend on
 * the threads. */
typedef struct first_error {
    long index;
    sdm_error err;
} first_error;

static void first_error_note(first_error *first, long index, const sdm_error *err)
{
#pragma omp critical(sdm_local_bases)
    if (first->index < 0 || index < first->index) first->index = index, first->err = *err;
}

static sdm_status first_error_status(const first_error *first, sdm_error *err)
{
    if (first->index < 0) return SDM_OK;
    if (err) *err = first->err;
    return first->err.status;
}

static sdm_status check_cancelled(const pod_state *pod, sdm_error *err)
{
    return trainer_cancelled(pod->t) ? sdm_fail(err, SDM_E_CANCELLED, "stopped on request")
                                     : SDM_OK;
}

static sdm_status lowest_level(basis_work *m, sdm_error *err)
{
    const pod_state *pod = m->pod;
    const long begin = (long)trainer_pod_first_block(pod, 0, m->share.first),
               end = (long)trainer_pod_first_block(pod, 0, m->share.end);
    size_t largest = 0;
    for (long b = begin; b < end; b++)
        if (sdm_pod_block_voxels(&pod->blocks[b]) > largest)
            largest = sdm_pod_block_voxels(&pod->blocks[b]);
    first_error first = {.index = -1};
#pragma omp parallel num_threads(pod->t->n_threads)
    {
        float *rows = NULL, *covariance = NULL;
        sdm_error mine = {0};
        sdm_status s = SDM_ALLOC(&rows, m->n * largest, "local bases", &mine);
        if (!s) s = SDM_ALLOC(&covariance, largest * largest, "local bases", &mine);
#pragma omp for schedule(dynamic)
        for (long b = begin; b < end; b++)
            if (s || check_cancelled(pod, &mine) ||
                lowest_level_block(m, (size_t)b, rows, covariance, &mine))
                first_error_note(&first, b, &mine);
        sdm_free(covariance);
        sdm_free(rows);
    }
    return first_error_status(&first, err);
}

static sdm_status upper_levels(basis_work *m, sdm_error *err)
{
    const sdm_pod_levels *levels = &m->pod->arch.levels;
    const long top = (long)levels->first[levels->n - 1], begin = top + (long)m->share.first,
               end = top + (long)m->share.end;
    first_error first = {.index = -1};
    if (levels->n == 1) return SDM_OK;
#pragma omp parallel for schedule(dynamic) num_threads(m->pod->t->n_threads)
    for (long root = begin; root < end; root++) {
        sdm_error mine = {0};
        if (check_cancelled(m->pod, &mine) || upper_levels_of_tree(m, (size_t)root, &mine))
            first_error_note(&first, root, &mine);
    }
    return first_error_status(&first, err);
}

/* Gives all ranks the mean map and the eigenvalues of the lowest level. s, err: of this rank. */
static sdm_status share_lowest_level(const basis_work *m, sdm_status s, sdm_error *err)
{
    const pod_state *pod = m->pod;
    s = sdm_comm_agree(pod->t->hooks.comm, s, err);
    if (!s)
        s = trainer_pod_gather(pod, 0, trainer_pod_place_voxel, sizeof *pod->mean, pod->mean, err);
    return s ? s
             : trainer_pod_gather(pod, 0, trainer_pod_place_block, m->keep * sizeof *m->values,
                                  m->values, err);
}

/* The same for the numbers of functions of all blocks. */
static sdm_status share_ranks(const basis_work *m, sdm_status s, sdm_error *err)
{
    const pod_state *pod = m->pod;
    s = sdm_comm_agree(pod->t->hooks.comm, s, err);
    for (size_t level = 1; level < pod->arch.levels.n && !s; level++)
        s = trainer_pod_gather(pod, level, trainer_pod_place_block, sizeof *pod->blocks,
                               pod->blocks, err);
    return s;
}

/* Numbers the coefficients by the ranks and copies the bases into one array, pod->basis. */
static sdm_status collect_bases(basis_work *m, sdm_error *err)
{
    pod_state *pod = m->pod;
    const sdm_pod_levels *levels = &pod->arch.levels;
    const size_t n_blocks = levels->first[levels->n];
    size_t count = 0;
    sdm_pod_number(levels, pod->blocks);
    sdm_status s = SDM_ALLOC(&pod->matrix_at, n_blocks + 1, "local bases", err);
    if (s) return s;
    for (size_t b = 0; b < n_blocks; b++) {
        pod->matrix_at[b] = count;
        count += pod->blocks[b].rank * sdm_pod_outputs(pod->blocks, b);
    }
    pod->matrix_at[n_blocks] = count;
    pod->arch.n_coefficients = sum_ranks(pod, levels->first[levels->n - 1], n_blocks);
    if ((s = SDM_ALLOC(&pod->basis, count, "local bases", err))) return s;
    for (size_t b = 0; b < n_blocks; b++) {
        if (!m->basis[b]) continue;
        memcpy(pod->basis + pod->matrix_at[b], m->basis[b],
               (pod->matrix_at[b + 1] - pod->matrix_at[b]) * sizeof *pod->basis);
        sdm_free(m->basis[b]);
        m->basis[b] = NULL;
    }
    for (size_t level = 0; level < levels->n && !s; level++)
        s = trainer_pod_gather(pod, level, trainer_pod_place_matrix, sizeof *pod->basis, pod->basis,
                               err);
    return s;
}

static sdm_status all_levels(basis_work *m, sdm_error *err)
{
    sdm_status s = lowest_level(m, err);
    s = share_lowest_level(m, s, err);
    if (s) return s;
    s = lowest_level_ranks(m, err);
    if (!s) s = upper_levels(m, err);
    s = share_ranks(m, s, err);
    return s ? s : collect_bases(m, err);
}

sdm_status trainer_bases_make(pod_state *pod, sdm_error *err)
{
    const size_t n = pod->t->data.n_static + pod->t->data.n_start;
    const size_t n_blocks = pod->arch.levels.first[pod->arch.levels.n];
    basis_work m = {.pod = pod,
                    .n = n < BASES_MAPS ? n : BASES_MAPS,
                    .keep = 4 * (size_t)pod->t->config->network.rank,
                    .share = trainer_pod_share(pod)};
    sdm_status s = SDM_ALLOC(&pod->mean, pod->arch.n_voxels, "mean map", err);
    if (!s) s = SDM_ALLOC(&m.slots, m.n, "local bases", err);
    if (!s) s = SDM_ALLOC(&m.lowest, pod->arch.n_voxels * m.keep, "local bases", err);
    if (!s) s = SDM_ALLOC(&m.values, pod->arch.levels.first[1] * m.keep, "local bases", err);
    if (!s) s = SDM_ALLOC(&m.basis, n_blocks, "local bases", err);
    // maps evenly spread over the slots
    for (size_t i = 0; i < m.n && !s; i++) m.slots[i] = i * n / m.n;
    if (!s) s = all_levels(&m, err);
    for (size_t b = 0; b < n_blocks && m.basis; b++) sdm_free(m.basis[b]);
    sdm_free(m.basis);
    sdm_free(m.values);
    sdm_free(m.lowest);
    sdm_free(m.slots);
    return s;
}
