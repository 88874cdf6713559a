/* The decoder of a pod network: latent variables -> coefficients -> map, and its transpose. A slab (pod_slabs.c) at a time, so that what
   it needs stays in the caches and rows of the map are written from end to end. Letters as in sdm/pod.h. */
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "pod_internal.h"

enum { GROUP = 6 }; // rows that go through a slab together: those of the kernels

static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }
static size_t padded(size_t floats) { return (floats + 15) / 16 * 16; }
static bool is_bytes(const pod_network *m) { return m->type == SDM_POD_I8; }
static size_t top_level(const pod_network *m) { return m->arch.levels.n - 1; }

// inputs of blocks: floats x[G][ld], or integers q[G][ld] with a factor for each row
typedef struct input {
    float *x;
    int16_t *q;
    float *scale; // [G]
    size_t ld;
} input;

// memory of a thread, for G rows
typedef struct space {
    float *y[SDM_POD_MAX_LEVELS]; // [G][padded outputs of a block]
    input x[SDM_POD_MAX_LEVELS];  // bytes, above the lowest level: those of blocks that get theirs together
    input leaves;                 // those of all blocks of the lowest level of a slab; scale: [groups][G]
    float *back; // [inputs of a slab, or of blocks that get theirs together] gradient there, rests of inputs
} space;

static float *take(float *memory, size_t *at, size_t floats)
{
    float *p = memory ? memory + *at : NULL;
    *at += padded(floats);
    return p;
}

// inputs with some to spare, which are read or written beside the last
static input take_inputs(const pod_network *m, size_t rows, size_t n, size_t scales, float *memory, size_t *at)
{
    input in = {.ld = padded(n + SDM_PANEL)};
    if (is_bytes(m))
        in.q = (int16_t *)take(memory, at, rows * in.ld / 2), in.scale = take(memory, at, scales);
    else
        in.x = take(memory, at, rows * in.ld);
    return in;
}

static size_t carve_thread(const pod_network *m, size_t rows, float *memory, space *s)
{
    size_t at = 0;
    *s = (space){0};
    for (size_t l = 0; l < m->arch.levels.n; l++)
        s->y[l] = take(memory, &at, rows * sdm_panel_outputs(m->max_outputs[l]));
    for (size_t l = 1; l < m->arch.levels.n && is_bytes(m); l++)
        s->x[l] = take_inputs(m, rows, m->max_group[l], rows, memory, &at);
    s->leaves = take_inputs(m, rows, m->max_slab, m->max_slab_groups * rows, memory, &at);
    size_t most = m->max_slab;
    for (size_t l = 0; l < m->arch.levels.n; l++)
        if (m->max_group[l] > most) most = m->max_group[l];
    s->back = take(memory, &at, most + SDM_PANEL);
    return at;
}

size_t sdm_pod_space_carve(const pod_network *m, size_t rows, int n_threads, float *memory, pod_space *w)
{
    const sdm_pod_arch *a = &m->arch;
    size_t at = 0, most = a->n_latent;
    for (size_t l = 0; l < a->levels.n; l++)
        if (m->max_group[l] > most) most = m->max_group[l];
    *w = (pod_space){.ldz = padded(a->n_latent + 1)};
    w->z = take(memory, &at, rows * a->n_latent);
    w->c = take(memory, &at, (rows + 1) * sdm_panel_outputs(a->n_coefficients)); // and a row for the rest of the first
    w->sorted = take(memory, &at, is_bytes(m) ? most + 1 : 0);
    w->z_integers = (int16_t *)take(memory, &at, is_bytes(m) ? (rows + 1) * w->ldz / 2 : 0);
    w->z_scale = take(memory, &at, is_bytes(m) ? rows + 1 : 0);
    w->threads = memory ? memory + at : NULL;
    space s;
    w->per_thread = carve_thread(m, smaller(rows + 1, GROUP), NULL, &s);
    return at + w->per_thread * (size_t)n_threads;
}

// what a slab is decoded with: G rows of a call of sdm_pod_decode()
typedef struct job {
    const pod_network *m;
    const sdm_grid *grid;
    size_t rows, with_mean;
    float *const *maps;
    const pod_slab *slab;
    size_t rests; // 1: the first row has a row of integers more, behind the last, of what rounding leaves of its inputs
    space s;
} job;

/* Into the map. */

static size_t first_voxel(const sdm_grid *g, const sdm_pod_block *b)
{
    return ((size_t)b->at[2] * (size_t)g->n[1] + b->at[1]) * (size_t)g->n[0] + b->at[0];
}

typedef float row4 __attribute__((vector_size(16), aligned(4)));

// a row of n voxels, with the mean where it is wanted
static inline void place_row(size_t n, const float *y, const float *mean, float *to)
{
    if (n == 4)
        *(row4 *)to = mean ? *(const row4 *)y + *(const row4 *)mean : *(const row4 *)y;
    else
        for (size_t x = 0; x < n; x++) to[x] = mean ? y[x] + mean[x] : y[x];
}

// a block of the lowest level, rows of n voxels, to its place in the map; the mean is added when wanted
static inline void place(const sdm_grid *g, const sdm_pod_block *b, size_t n, const float *y, const float *mean,
                         float *map)
{
    const size_t line = (size_t)g->n[0], plane = line * (size_t)g->n[1];
    float *layer = map + first_voxel(g, b);
    for (size_t z = 0; z < b->size[2]; z++, layer += plane) {
        float *to = layer;
        for (size_t v = 0; v < b->size[1]; v++, y += n, to += line) {
            place_row(n, y, mean, to);
            if (mean) mean += n;
        }
    }
}

/* Through the blocks. */

static input input_from(input in, size_t first)
{
    if (in.x) in.x += first;
    if (in.q) in.q += first;
    return in;
}

// a row of n numbers as integers x; their factor
static float quantise_row(size_t n, const float *y, const float *factor, int limit, int16_t *x)
{
    x[n] = 0; // read beside an odd last one, times zero
    return sdm_quantise(n, y, factor, limit, x);
}

// what x[n], with its factor, leaves of y times factor
static float quantise_rest(size_t n, const float *y, const float *factor, int limit, const int16_t *x, float scale,
                           float *work, int16_t *rest)
{
    for (size_t i = 0; i < n; i++) work[i] = y[i] * factor[i] - scale * (float)x[i];
    rest[n] = 0;
    return sdm_quantise(n, work, NULL, limit, rest);
}

// y[0] += the row behind the last
static void add_rest(size_t rows, size_t rests, size_t n, float *y, size_t ldy)
{
    for (size_t i = 0; i < n && rests; i++) y[i] += y[rows * ldy + i];
}

static void block_product(const job *j, size_t b, const input *in, float *y, size_t ldy)
{
    const pod_network *m = j->m;
    if (is_bytes(m)) {
        sdm_panel_i8(j->rows + j->rests, m->outputs[b], m->coarse[b], m->blocks[b].rank,
                     (const int8_t *)m->basis + m->weights_at[b], in->q, in->ld, in->scale, y, ldy);
        add_rest(j->rows, j->rests, m->outputs[b], y, ldy);
    } else {
        sdm_pod_product(m->type, j->rows, m->outputs[b], m->blocks[b].rank, m->basis, m->weights_at[b], in->x, in->ld,
                        y, ldy);
    }
}

// n coefficients of `level` from `first` on, c[G][ldc], as integers
static void quantise(const job *j, size_t level, size_t first, size_t n, const float *c, size_t ldc, const input *to)
{
    const pod_network *m = j->m;
    const float *factor = m->factor + m->coefficients_at[level] + first;
    for (size_t r = 0; r < j->rows; r++)
        to->scale[r] = quantise_row(n, c + r * ldc, factor, m->limit[level], to->q + r * to->ld);
    if (j->rests)
        to->scale[j->rows] =
            quantise_rest(n, c, factor, m->limit[level], to->q, to->scale[0], j->s.back, to->q + j->rows * to->ld);
}

// where the coefficients of the lowest level of block `group` of its groups belong
static input inputs_of_leaves(const job *j, size_t group)
{
    const pod_network *m = j->m;
    const sdm_pod_block *g = &m->blocks[group];
    const uint32_t first = m->arch.levels.n > 1 ? m->blocks[g->child].coefficient : g->coefficient;
    input in = input_from(j->s.leaves, first - j->slab->coefficient);
    if (in.scale) in.scale += (group - j->slab->group) * (j->rows + j->rests);
    return in;
}

// levels above the lowest from block b of `level` down to the inputs of its leaves
static void decode_upper(const job *j, size_t b, size_t level, const input *in)
{
    const pod_network *m = j->m;
    const sdm_pod_block *k = &m->blocks[b];
    const uint32_t first = m->blocks[k->child].coefficient;
    const size_t ldy = sdm_panel_outputs(m->max_outputs[level]);
    if (level == 1) {
        const input to = inputs_of_leaves(j, b);
        if (!is_bytes(m)) { // filling up goes where the next group will be
            block_product(j, b, in, to.x, to.ld);
            return;
        }
        block_product(j, b, in, j->s.y[1], ldy);
        quantise(j, 0, first, m->outputs[b], j->s.y[1], ldy, &to);
        return;
    }
    float *y = j->s.y[level];
    block_product(j, b, in, y, ldy);
    input below = {.x = y, .ld = ldy};
    if (is_bytes(m)) below = j->s.x[level - 1], quantise(j, level - 1, first, m->outputs[b], y, ldy, &below);
    for (size_t i = k->child; i < k->child + k->n_children; i++) {
        const input of_child = input_from(below, m->blocks[i].coefficient - first);
        decode_upper(j, i, level - 1, &of_child);
    }
}

// block b of the highest level from its coefficients c[G][ldc]
static void decode_top(const job *j, size_t b, float *c, size_t ldc)
{
    const pod_network *m = j->m;
    const size_t top = top_level(m), rank = m->blocks[b].rank, first = m->blocks[b].coefficient;
    if (top == 0) {
        const input to = inputs_of_leaves(j, b);
        if (is_bytes(m)) quantise(j, 0, first, rank, c, ldc, &to);
        for (size_t r = 0; r < j->rows && !is_bytes(m); r++) memcpy(to.x + r * to.ld, c + r * ldc, rank * sizeof *c);
        return;
    }
    input in = {.x = c, .ld = ldc};
    if (is_bytes(m)) in = j->s.x[top], quantise(j, top, first, rank, c, ldc, &in);
    decode_upper(j, b, top, &in);
}

static void decode_leaves(const job *j)
{
    const pod_network *m = j->m;
    const size_t ldy = sdm_panel_outputs(m->max_outputs[0]);
    const float *mean = m->mean + m->blocks[j->slab->leaf].voxel;
    for (size_t i = j->slab->leaf; i < j->slab->leaf_end; i++) {
        const pod_leaf leaf = m->leaves[i];
        const sdm_pod_block *k = &m->blocks[leaf.block];
        input in = input_from(j->s.leaves, k->coefficient - j->slab->coefficient);
        if (in.scale) in.scale += leaf.group * (j->rows + j->rests);
        block_product(j, leaf.block, &in, j->s.y[0], ldy);
        for (size_t r = 0; r < j->rows; r++) {
            const float *y = j->s.y[0] + r * ldy, *add = r < j->with_mean ? mean : NULL;
            if (k->size[0] == 4)
                place(j->grid, k, 4, y, add, j->maps[r]);
            else
                place(j->grid, k, k->size[0], y, add, j->maps[r]);
        }
        mean += m->outputs[leaf.block];
    }
}

static void decode_slab(const job *j, float *c, size_t ldc)
{
    for (size_t b = j->slab->top; b < j->slab->top_end; b++) decode_top(j, b, c + j->m->blocks[b].coefficient, ldc);
    decode_leaves(j);
}

/* The head. */

// latent variables in the order of the head's columns, as integers
static void quantise_latent(const pod_network *m, size_t rows, size_t rests, const pod_space *w)
{
    const size_t latent = m->arch.n_latent, n = m->arch.levels.n;
    const float *factor = m->factor + m->coefficients_at[n];
    for (size_t r = rows; r-- > 0;) { // the first is the last, for its rest
        for (size_t i = 0; i < latent; i++) w->sorted[i] = w->z[r * latent + m->order[i]];
        w->z_scale[r] = quantise_row(latent, w->sorted, factor, m->limit[n], w->z_integers + r * w->ldz);
    }
    if (rests)
        w->z_scale[rows] = quantise_rest(latent, w->sorted, factor, m->limit[n], w->z_integers, w->z_scale[0],
                                         w->sorted, w->z_integers + rows * w->ldz);
}

// coefficients `at` to `at` + n of the highest level
static void head_product(const pod_network *m, size_t rows, size_t rests, size_t at, size_t n, const pod_space *w)
{
    const size_t latent = m->arch.n_latent, coarse = sdm_pod_head_coarse(m);
    const size_t weights = sdm_pod_count_weights(m->type, at, coarse, latent);
    const size_t ldc = sdm_panel_outputs(m->arch.n_coefficients);
    if (is_bytes(m)) {
        sdm_panel_i8(rows + rests, n, coarse, latent, (const int8_t *)m->head + weights, w->z_integers, w->ldz,
                     w->z_scale, w->c + at, ldc);
        add_rest(rows, rests, n, w->c + at, ldc);
    } else
        sdm_pod_product(m->type, rows, n, latent, m->head, weights, w->z, latent, w->c + at, ldc);
}

void sdm_pod_decode(const pod_network *m, const sdm_grid *grid, size_t rows, size_t with_mean, bool smooth,
                    float *const *maps, const pod_space *w, int n_threads)
{
    const size_t rests = smooth && is_bytes(m) ? 1 : 0;
    enum { PART = 32 * SDM_PANEL };
    const size_t coefficients = m->arch.n_coefficients, ldc = sdm_panel_outputs(coefficients);
    const long parts = (long)((coefficients + PART - 1) / PART);
    if (is_bytes(m)) quantise_latent(m, rows, rests, w);
#ifdef _OPENMP
#pragma omp parallel num_threads(n_threads) if (n_threads > 1)
#else
    (void)n_threads;
#endif
    {
        size_t thread = 0;
        job j = {.m = m, .grid = grid};
#ifdef _OPENMP
        thread = (size_t)omp_get_thread_num();
#pragma omp for schedule(static)
#endif
        for (long i = 0; i < parts; i++) {
            const size_t o = (size_t)i * PART;
            head_product(m, rows, rests, o, smaller(PART, coefficients - o), w);
        }
        carve_thread(m, smaller(rows + 1, GROUP), w->threads + thread * w->per_thread, &j.s);
#ifdef _OPENMP
#pragma omp for schedule(dynamic)
#endif
        for (long i = 0; i < (long)m->n_slabs; i++)
            for (size_t r = 0; r < rows; r += j.rows) {
                j.slab = &m->slabs[i];
                j.rests = r == 0 ? rests : 0;
                j.rows = smaller(GROUP - j.rests, rows - r);
                j.with_mean = with_mean > r ? with_mean - r : 0;
                j.maps = maps + r;
                decode_slab(&j, w->c + r * ldc, ldc);
            }
    }
}

/* The transpose. */

// x[rank] = gradient at the coefficients of block b, from y at its outputs; y is read beside the last, times zero
static void block_back(const pod_network *m, size_t b, size_t level, const float *y, float *sorted, float *x)
{
    const sdm_pod_block *k = &m->blocks[b];
    if (!is_bytes(m)) {
        sdm_pod_product_back(m->type, m->outputs[b], k->rank, m->basis, m->weights_at[b], y, x);
        return;
    }
    const float *factor = m->factor + m->coefficients_at[level] + k->coefficient;
    sdm_panel_back_i8(m->outputs[b], m->coarse[b], k->rank, (const int8_t *)m->basis + m->weights_at[b], y, sorted);
    for (size_t i = 0; i < k->rank; i++) x[i] = factor[i] * sorted[i];
}

static void back_leaves(const job *j, const float *adjoint, float *sorted)
{
    const pod_network *m = j->m;
    const size_t line = (size_t)j->grid->n[0], plane = line * (size_t)j->grid->n[1];
    float *y = j->s.y[0];
    for (size_t i = j->slab->leaf; i < j->slab->leaf_end; i++) {
        const size_t b = m->leaves[i].block;
        const sdm_pod_block *k = &m->blocks[b];
        const float *from = adjoint + first_voxel(j->grid, k);
        float *to = y;
        for (size_t z = 0; z < k->size[2]; z++, from += plane)
            for (size_t v = 0; v < k->size[1]; v++, to += k->size[0])
                memcpy(to, from + v * line, k->size[0] * sizeof *to);
        memset(to, 0, (sdm_panel_outputs(m->outputs[b]) - m->outputs[b]) * sizeof *to);
        block_back(m, b, 0, y, sorted, j->s.back + (k->coefficient - j->slab->coefficient));
    }
    memset(j->s.back + j->slab->n_coefficients, 0, SDM_PANEL * sizeof *j->s.back);
}

// x[rank] = gradient at the coefficients of block b of `level`
static void back_upper(const job *j, size_t b, size_t level, float *sorted, float *x)
{
    const pod_network *m = j->m;
    const sdm_pod_block *k = &m->blocks[b];
    if (level == 0) {
        memcpy(x, j->s.back + (k->coefficient - j->slab->coefficient), k->rank * sizeof *x);
        return;
    }
    const uint32_t first = m->blocks[k->child].coefficient;
    float *y = j->s.y[level];
    for (size_t i = k->child; i < k->child + k->n_children; i++)
        back_upper(j, i, level - 1, sorted, y + (m->blocks[i].coefficient - first));
    memset(y + m->outputs[b], 0, (sdm_panel_outputs(m->outputs[b]) - m->outputs[b]) * sizeof *y);
    block_back(m, b, level, y, sorted, x);
}

void sdm_pod_decode_back(const pod_network *m, const sdm_grid *grid, const float *adjoint, const pod_space *w,
                         float *dz)
{
    const size_t coefficients = m->arch.n_coefficients, latent = m->arch.n_latent, n = m->arch.levels.n;
    job j = {.m = m, .grid = grid, .rows = 1};
    carve_thread(m, 1, w->threads, &j.s);
    for (size_t i = 0; i < m->n_slabs; i++) {
        j.slab = &m->slabs[i];
        back_leaves(&j, adjoint, w->sorted);
        for (size_t b = j.slab->top; b < j.slab->top_end; b++)
            back_upper(&j, b, n - 1, w->sorted, w->c + m->blocks[b].coefficient);
    }
    memset(w->c + coefficients, 0, (sdm_panel_outputs(coefficients) - coefficients) * sizeof *w->c);
    if (!is_bytes(m)) {
        sdm_pod_product_back(m->type, coefficients, latent, m->head, 0, w->c, dz);
        return;
    }
    sdm_panel_back_i8(coefficients, sdm_pod_head_coarse(m), latent, m->head, w->c, w->sorted);
    for (size_t i = 0; i < latent; i++) dz[m->order[i]] = m->factor[m->coefficients_at[n] + i] * w->sorted[i];
}
