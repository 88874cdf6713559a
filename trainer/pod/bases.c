/* The spectral start: nested local bases by proper orthogonal decomposition in blocks of voxels.
   Linear algebra on maps that are there: no optimiser yet. */
#include <stdlib.h>
#include <string.h>

#include "coefficients.h"
#include "data/streams.h"
#include "linalg.h"
#include "pod_tree.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "trainer.h"

// maps that the bases are made from: more change the error they leave on unseen shapes by a few per
// cent
enum { BASES_MAPS = 4096 };

typedef struct candidate {
    double worth; // variance it explains for each weight it costs
    uint32_t block;
} candidate;

static int by_worth(const void *a, const void *b)
{
    const candidate *x = a, *y = b;
    if (x->worth != y->worth) return x->worth < y->worth ? 1 : -1;
    return x->block < y->block ? -1 : x->block > y->block;
}

/* The bases while they are made. A function is worth its weights when the variance it explains,
   divided by their number (its own and those that give its coefficient), is above `worth`: the same
   for all levels, so that the error is least for the number of weights. */
typedef struct spectrum {
    trainer *t;
    size_t n, *slots; // maps to learn from
    size_t keep;      // functions of a block of the lowest level at most
    float *lowest;    // [n_voxels][keep] eigenvectors of the lowest level, block after block
    double *values;   // [blocks of the lowest level][keep]
    double worth;
    float **basis; // [blocks] [k_b][V_b]
} spectrum;

// weights that give one coefficient of a function of `level`: an estimate, since the ranks above
// are not known yet
static double cost_above(const trainer *t, size_t level)
{
    const double rank = t->config->network.rank;
    if (level + 1 == t->arch.levels.n) return (double)t->arch.n_latent;
    return level ? 4 * rank : 2.5 * rank;
}

static sdm_status eigenvectors(const spectrum *m, size_t block, size_t n, const float *rows,
                               size_t stride, size_t outputs, size_t keep, float *covariance,
                               float *vectors, double *values, sdm_error *err)
{
    sdm_gemm(outputs, outputs, n, (sdm_view){rows, 1, stride}, (sdm_view){rows, stride, 1}, false,
             covariance, outputs, 1);
    for (size_t i = 0; i < outputs * outputs; i++) covariance[i] /= (float)n;
    return leading_eigenvectors(outputs, covariance, keep, m->t->config->seed,
                                STREAM_BASES + 1 + block, vectors, values, err);
}

static size_t least(size_t a, size_t b) { return a < b ? a : b; }

// n maps span n functions at most: more would be rounding
static size_t kept(const spectrum *m, size_t outputs)
{
    return least(m->keep, least(outputs, m->n));
}

// mean and leading eigenvectors of a block of the lowest level
static sdm_status lowest_block(spectrum *m, size_t index, float *rows, float *covariance,
                               sdm_error *err)
{
    trainer *t = m->t;
    const sdm_pod_block *b = &t->blocks[index];
    const size_t voxels = sdm_pod_block_voxels(b);
    float *mean = t->mean + b->voxel;
    memset(mean, 0, voxels * sizeof *mean);
    coefficients_rows(t, b, false, m->slots, m->n, rows);
    for (size_t v = 0; v < voxels; v++) {
        double sum = 0;
        for (size_t i = 0; i < m->n; i++) sum += rows[i * voxels + v];
        mean[v] = (float)(sum / (double)m->n);
    }
    for (size_t i = 0; i < m->n; i++)
        for (size_t v = 0; v < voxels; v++) rows[i * voxels + v] -= mean[v];
    return eigenvectors(m, index, m->n, rows, voxels, voxels, kept(m, voxels), covariance,
                        m->lowest + b->voxel * m->keep, m->values + index * m->keep, err);
}

// ranks of the lowest level: the functions that are worth most, network.rank a block, at least one
// in each block; sets `worth`
static sdm_status choose_lowest(spectrum *m, sdm_error *err)
{
    trainer *t = m->t;
    const size_t n_blocks = t->arch.levels.first[1],
                 wanted = (size_t)t->config->network.rank * n_blocks;
    candidate *c = NULL;
    size_t n = 0;
    sdm_status s = SDM_ALLOC(&c, n_blocks * m->keep, "basis candidates", err);
    for (size_t b = 0; b < n_blocks && !s; b++) {
        const size_t voxels = sdm_pod_block_voxels(&t->blocks[b]);
        t->blocks[b].rank = 1;
        for (size_t i = 1; i < kept(m, voxels); i++)
            c[n++] = (candidate){m->values[b * m->keep + i] / ((double)voxels + cost_above(t, 0)),
                                 (uint32_t)b};
    }
    if (!s) qsort(c, n, sizeof *c, by_worth);
    for (size_t i = 0; i < n && i + n_blocks < wanted && !s; i++) {
        t->blocks[c[i].block].rank++;
        m->worth = c[i].worth;
    }
    sdm_free(c);
    for (size_t b = 0; b < n_blocks && !s; b++) {
        const size_t size = t->blocks[b].rank * sdm_pod_block_voxels(&t->blocks[b]);
        if (!(s = SDM_ALLOC(&m->basis[b], size, "local bases", err)))
            memcpy(m->basis[b], m->lowest + t->blocks[b].voxel * m->keep, size * sizeof **m->basis);
    }
    // on fine grids these are gigabytes, most of them not chosen
    sdm_free(m->lowest);
    m->lowest = NULL;
    return s;
}

// sum of the ranks of the blocks first .. end - 1
static size_t ranks_of(const trainer *t, size_t first, size_t end)
{
    size_t n = 0;
    for (size_t b = first; b < end; b++) n += t->blocks[b].rank;
    return n;
}

// basis of block `index` above the lowest level from below[n][stride], the coefficients of its
// children
static sdm_status upper_block(spectrum *m, size_t level, size_t index, const float *below,
                              size_t stride, sdm_error *err)
{
    sdm_pod_block *b = &m->t->blocks[index];
    const size_t outputs = ranks_of(m->t, b->child, b->child + b->n_children);
    const size_t keep = least(16 * (size_t)m->t->config->network.rank, least(outputs, m->n));
    float *covariance = NULL, *vectors = NULL;
    double *values = NULL;
    sdm_status s = SDM_ALLOC(&covariance, outputs * outputs, "local bases", err);
    if (!s) s = SDM_ALLOC(&vectors, keep * outputs, "local bases", err);
    if (!s) s = SDM_ALLOC(&values, keep, "local bases", err);
    if (!s)
        s = eigenvectors(m, index, m->n, below, stride, outputs, keep, covariance, vectors, values,
                         err);
    b->rank = 1;
    while (!s && b->rank < keep &&
           values[b->rank] > m->worth * ((double)outputs + cost_above(m->t, level)))
        b->rank++;
    sdm_free(covariance);
    sdm_free(values);
    m->basis[index] = vectors;
    return s;
}

// the levels above the lowest, for the blocks below `root`
static sdm_status upper_levels(spectrum *m, size_t root, sdm_error *err)
{
    const trainer *t = m->t;
    const pod_tree tree = pod_tree_of(&t->arch.levels, t->blocks, root);
    float *rows = NULL, *below = NULL, *here = NULL;
    size_t ldb = ranks_of(t, tree.first[0], tree.end[0]), at = 0;
    sdm_status s = SDM_ALLOC(&rows, m->n * tree.largest, "local bases", err);
    if (!s) s = SDM_ALLOC(&below, m->n * ldb, "local coefficients", err);
    if (!s) s = SDM_ALLOC(&here, m->n * ldb, "local coefficients", err);
    for (size_t b = tree.first[0]; b < tree.end[0] && !s; b++) {
        const sdm_pod_block *k = &t->blocks[b];
        const size_t voxels = sdm_pod_block_voxels(k);
        coefficients_rows(t, k, false, m->slots, m->n, rows);
        coefficients_project(m->n, k->rank, voxels, m->basis[b], rows, voxels, below + at, ldb);
        at += k->rank;
    }
    for (size_t level = 1; level < t->arch.levels.n && !s; level++) {
        size_t child = 0;
        at = 0;
        for (size_t b = tree.first[level]; b < tree.end[level] && !s; b++) {
            s = upper_block(m, level, b, below + child, ldb, err);
            child += ranks_of(t, t->blocks[b].child, t->blocks[b].child + t->blocks[b].n_children);
        }
        const size_t ldh = ranks_of(t, tree.first[level], tree.end[level]);
        child = 0;
        for (size_t b = tree.first[level]; b < tree.end[level] && !s; b++) {
            const sdm_pod_block *k = &t->blocks[b];
            const size_t outputs = ranks_of(t, k->child, k->child + k->n_children);
            coefficients_project(m->n, k->rank, outputs, m->basis[b], below + child, ldb, here + at,
                                 ldh);
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

// the first error of a loop over blocks: of the lowest index, so that it does not depend on the
// threads
typedef struct first_error {
    long index;
    sdm_error err;
} first_error;

static void note_error(first_error *first, long index, const sdm_error *err)
{
#pragma omp critical(sdm_local_bases)
    if (first->index < 0 || index < first->index) first->index = index, first->err = *err;
}

static sdm_status first_status(const first_error *first, sdm_error *err)
{
    if (first->index < 0) return SDM_OK;
    if (err) *err = first->err;
    return first->err.status;
}

static sdm_status stopped(const trainer *t, sdm_error *err)
{
    return trainer_cancelled(t) ? sdm_fail(err, SDM_E_CANCELLED, "stopped on request") : SDM_OK;
}

static sdm_status lowest_level(spectrum *m, sdm_error *err)
{
    const trainer *t = m->t;
    const long n_blocks = (long)t->arch.levels.first[1];
    size_t largest = 0;
    for (long b = 0; b < n_blocks; b++)
        if (sdm_pod_block_voxels(&t->blocks[b]) > largest)
            largest = sdm_pod_block_voxels(&t->blocks[b]);
    first_error first = {.index = -1};
#pragma omp parallel num_threads(t->n_threads)
    {
        float *rows = NULL, *covariance = NULL;
        sdm_error mine = {0};
        sdm_status s = SDM_ALLOC(&rows, m->n * largest, "local bases", &mine);
        if (!s) s = SDM_ALLOC(&covariance, largest * largest, "local bases", &mine);
#pragma omp for schedule(dynamic)
        for (long b = 0; b < n_blocks; b++)
            if (s || stopped(t, &mine) || lowest_block(m, (size_t)b, rows, covariance, &mine))
                note_error(&first, b, &mine);
        sdm_free(covariance);
        sdm_free(rows);
    }
    return first_status(&first, err);
}

static sdm_status upper_trees(spectrum *m, sdm_error *err)
{
    const sdm_pod_levels *levels = &m->t->arch.levels;
    const long begin = (long)levels->first[levels->n - 1], end = (long)levels->first[levels->n];
    first_error first = {.index = -1};
    if (levels->n == 1) return SDM_OK;
#pragma omp parallel for schedule(dynamic) num_threads(m->t->n_threads)
    for (long root = begin; root < end; root++) {
        sdm_error mine = {0};
        if (stopped(m->t, &mine) || upper_levels(m, (size_t)root, &mine))
            note_error(&first, root, &mine);
    }
    return first_status(&first, err);
}

// numbers blocks, weights and coefficients by the ranks, and gathers the bases
static sdm_status collect(spectrum *m, sdm_error *err)
{
    trainer *t = m->t;
    const sdm_pod_levels *levels = &t->arch.levels;
    const size_t n_blocks = levels->first[levels->n];
    size_t count = 0;
    sdm_pod_number(levels, t->blocks);
    sdm_status s = SDM_ALLOC(&t->matrix_at, n_blocks + 1, "local bases", err);
    if (s) return s;
    for (size_t b = 0; b < n_blocks; b++) {
        t->matrix_at[b] = count;
        count += t->blocks[b].rank * sdm_pod_outputs(t->blocks, b);
    }
    t->matrix_at[n_blocks] = count;
    t->arch.n_coefficients = ranks_of(t, levels->first[levels->n - 1], n_blocks);
    if ((s = SDM_ALLOC(&t->basis, count, "local bases", err))) return s;
    for (size_t b = 0; b < n_blocks; b++) {
        memcpy(t->basis + t->matrix_at[b], m->basis[b],
               (t->matrix_at[b + 1] - t->matrix_at[b]) * sizeof *t->basis);
        sdm_free(m->basis[b]);
        m->basis[b] = NULL;
    }
    return SDM_OK;
}

static sdm_status local_bases(trainer *t, size_t n, sdm_error *err)
{
    const size_t n_blocks = t->arch.levels.first[t->arch.levels.n];
    spectrum m = {
        .t = t, .n = n < BASES_MAPS ? n : BASES_MAPS, .keep = 4 * (size_t)t->config->network.rank};
    sdm_status s = SDM_ALLOC(&m.slots, m.n, "local bases", err);
    if (!s) s = SDM_ALLOC(&m.lowest, t->arch.n_voxels * m.keep, "local bases", err);
    if (!s) s = SDM_ALLOC(&m.values, t->arch.levels.first[1] * m.keep, "local bases", err);
    if (!s) s = SDM_ALLOC(&m.basis, n_blocks, "local bases", err);
    for (size_t i = 0; i < m.n && !s; i++) m.slots[i] = i * n / m.n;
    if (!s) s = lowest_level(&m, err);
    if (!s) s = choose_lowest(&m, err);
    if (!s) s = upper_trees(&m, err);
    if (!s) s = collect(&m, err);
    for (size_t b = 0; b < n_blocks && m.basis; b++) sdm_free(m.basis[b]);
    sdm_free(m.basis);
    sdm_free(m.values);
    sdm_free(m.lowest);
    sdm_free(m.slots);
    return s;
}

sdm_status bases_slots(size_t n, size_t **slots, sdm_error *err)
{
    const sdm_status s = SDM_ALLOC(slots, n, "numbers of maps", err);
    for (size_t i = 0; i < n && !s; i++) (*slots)[i] = i;
    return s;
}

sdm_status bases_make(trainer *t, sdm_error *err)
{
    const size_t n = t->data.n_static + t->data.n_start;
    sdm_status s = SDM_ALLOC(&t->mean, t->arch.n_voxels, "mean map", err);
    if (!s) s = local_bases(t, n, err);
    return s ? s : modes_make(t, n, err);
}

void bases_dispose(trainer *t)
{
    sdm_free(t->mean);
    sdm_free(t->basis);
    sdm_free(t->matrix_at);
    sdm_free(t->deviation);
    sdm_free(t->modes);
    sdm_free(t->poly);
    sdm_free(t->phi);
    sdm_free(t->target);
    sdm_free(t->holdout_phi);
    sdm_free(t->holdout_target);
}
