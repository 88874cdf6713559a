/* The pod network at work: latent variables -> coefficients -> map, with derivatives in forward and reverse mode. No allocation.
   Letters as in sdm/pod.h; R rows that go through the decoder together (maps, or a map and its derivatives). */
#include <string.h>
#ifdef _OPENMP
#include <omp.h>
#endif

#include "pod_internal.h"
#include "sdm/kernels.h"

// rows for which the head is read once, and rows that go through a block of the highest level together: those of the kernels, so that
// what they need of the block, weights and maps, stays in the second-level cache
enum { ROWS = 24, GROUP = 6 };

static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

// rows as integers, each with the factor that gives it back
typedef struct integers {
    int16_t *x;
    float *scale; // [R]
    size_t ld;
} integers;

// scratch, carved from the caller's block
typedef struct workspace {
    pod_latent latent;
    float *z;                     // [R][L]
    float *c;                     // [R][padded K]
    float *y[SDM_POD_MAX_LEVELS]; // [G][padded outputs of a block], for each thread; G rows of a group
    // bytes only: inputs of the head, and of the blocks of a level that get theirs together, as integers
    integers z_integers, x_integers[SDM_POD_MAX_LEVELS]; // [R][padded L]; [G][padded group], for each thread
    float *sorted; // [padded L, or most inputs of a block] in the order of columns
    size_t per_thread;
} workspace;

static size_t padded(size_t floats) { return (floats + 15) / 16 * 16; }

// rows of n integers, and one more that is read, from memory[at]; returns their floats
static size_t carve_integers(size_t rows, size_t n, float *memory, size_t at, integers *to)
{
    *to = (integers){.ld = padded(n + 1)};
    if (memory) to->scale = memory + at, to->x = (int16_t *)(memory + at + padded(rows));
    return padded(rows) + rows * to->ld / 2;
}

static size_t carve(const pod_network *m, size_t rows, int n_threads, float *memory, workspace *w)
{
    const sdm_pod_arch *a = &m->arch;
    const size_t group = smaller(rows, GROUP);
    size_t total = sdm_pod_latent_carve(m, rows, memory, &w->latent);
    w->z = memory ? memory + total : NULL;
    total += padded(rows * a->n_latent);
    w->c = memory ? memory + total : NULL;
    total += rows * sdm_panel_outputs(a->n_coefficients);
    if (m->type == SDM_POD_I8) {
        size_t most = a->n_latent;
        for (size_t l = 0; l < a->levels.n; l++)
            if (m->max_group[l] > most) most = m->max_group[l];
        w->sorted = memory ? memory + total : NULL;
        total += padded(most + 1);
        total += padded(carve_integers(rows, a->n_latent, memory, total, &w->z_integers));
    }
    w->per_thread = 0;
    for (size_t l = 0; l < a->levels.n; l++) {
        w->y[l] = memory ? memory + total + w->per_thread : NULL;
        w->per_thread += group * sdm_panel_outputs(m->max_outputs[l]);
        if (m->type == SDM_POD_I8)
            w->per_thread +=
                padded(carve_integers(group, m->max_group[l], memory, total + w->per_thread, &w->x_integers[l]));
    }
    return (total + w->per_thread * (size_t)n_threads) * sizeof(float);
}

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
    float *slab = map + first_voxel(g, b);
    for (size_t z = 0; z < b->size[2]; z++, slab += plane) {
        float *to = slab;
        for (size_t v = 0; v < b->size[1]; v++, y += n, to += line) {
            place_row(n, y, mean, to);
            if (mean) mean += n;
        }
    }
}

// what a call of decode() works on, or a group of its rows
typedef struct job {
    const sdm_grid *grid;
    const pod_network *m;
    size_t rows, with_mean; // the mean is added to the first `with_mean` rows
    float *const *maps;
    const workspace *w;
} job;

static job group_of(const job *j, size_t first)
{
    job g = *j;
    g.rows = smaller(GROUP, j->rows - first);
    g.with_mean = j->with_mean > first ? j->with_mean - first : 0;
    g.maps += first;
    return g;
}

// what goes into a block: floats, or integers when weights are bytes
typedef struct input {
    const float *x; // [R][ld]
    integers q;     // [R][q.ld]
    size_t ld;
} input;

static input input_from(input in, size_t first)
{
    if (in.x) in.x += first;
    if (in.q.x) in.q.x += first;
    return in;
}

// n coefficients of `level` from `first` on, c[R][ldc], made ready for their blocks
static input ready(const job *j, size_t level, size_t first, size_t n, size_t thread, const float *c, size_t ldc)
{
    const pod_network *m = j->m;
    if (m->type != SDM_POD_I8) return (input){.x = c, .ld = ldc};
    integers q = j->w->x_integers[level];
    q.x += 2 * thread * j->w->per_thread; // counted in floats
    q.scale += thread * j->w->per_thread;
    const float *factor = m->factor + m->coefficients_at[level] + first;
    for (size_t r = 0; r < j->rows; r++) {
        q.scale[r] = sdm_quantise(n, c + r * ldc, factor, m->limit[level], q.x + r * q.ld);
        q.x[r * q.ld + n] = 0; // read beside an odd last one, times zero
    }
    return (input){.q = q};
}

static void block_product(const job *j, size_t b, const input *in, float *y, size_t ldy)
{
    const pod_network *m = j->m;
    if (m->type == SDM_POD_I8)
        sdm_panel_i8(j->rows, m->outputs[b], m->coarse[b], m->blocks[b].rank,
                     (const int8_t *)m->basis + m->weights_at[b], in->q.x, in->q.ld, in->q.scale, y, ldy);
    else
        sdm_pod_product(m->type, j->rows, m->outputs[b], m->blocks[b].rank, m->basis, m->weights_at[b], in->x, in->ld,
                        y, ldy);
}

static void decode_block(const job *j, size_t b, size_t level, size_t thread, input in)
{
    const pod_network *m = j->m;
    const sdm_pod_block *k = &m->blocks[b];
    const size_t ldy = sdm_panel_outputs(m->max_outputs[level]);
    float *y = j->w->y[level] + thread * j->w->per_thread;
    block_product(j, b, &in, y, ldy);
    if (level > 0) {
        const uint32_t first = m->blocks[k->child].coefficient;
        const input below = ready(j, level - 1, first, m->outputs[b], thread, y, ldy);
        for (size_t i = k->child; i < k->child + k->n_children; i++)
            decode_block(j, i, level - 1, thread, input_from(below, m->blocks[i].coefficient - first));
        return;
    }
    for (size_t r = 0; r < j->rows; r++) {
        const float *mean = r < j->with_mean ? m->mean + k->voxel : NULL;
        if (k->size[0] == 4)
            place(j->grid, k, 4, y + r * ldy, mean, j->maps[r]);
        else
            place(j->grid, k, k->size[0], y + r * ldy, mean, j->maps[r]);
    }
}

// coefficients `at` to `at` + n of the highest level
static void head_product(const job *j, size_t at, size_t n, size_t ldc)
{
    const pod_network *m = j->m;
    const size_t latent = m->arch.n_latent, coarse = sdm_pod_head_coarse(m);
    const size_t weights = sdm_pod_count_weights(m->type, at, coarse, latent);
    if (m->type == SDM_POD_I8)
        sdm_panel_i8(j->rows, n, coarse, latent, (const int8_t *)m->head + weights, j->w->z_integers.x,
                     j->w->z_integers.ld, j->w->z_integers.scale, j->w->c + at, ldc);
    else
        sdm_pod_product(m->type, j->rows, n, latent, m->head, weights, j->w->z, latent, j->w->c + at, ldc);
}

// latent variables in the order of the head's columns, as integers
static void quantise_latent(const job *j)
{
    const pod_network *m = j->m;
    const size_t latent = m->arch.n_latent;
    const integers *q = &j->w->z_integers;
    const float *factor = m->factor + m->coefficients_at[m->arch.levels.n];
    float *sorted = j->w->sorted;
    for (size_t r = 0; r < j->rows; r++) {
        for (size_t i = 0; i < latent; i++) sorted[i] = j->w->z[r * latent + m->order[i]];
        q->scale[r] = sdm_quantise(latent, sorted, factor, m->limit[m->arch.levels.n], q->x + r * q->ld);
        q->x[r * q->ld + latent] = 0;
    }
}

// z[R][L] -> maps[R]
static void decode(const job *j, int n_threads)
{
    enum { PART = 32 * SDM_PANEL };
    const pod_network *m = j->m;
    const sdm_pod_arch *a = &m->arch;
    const size_t ldc = sdm_panel_outputs(a->n_coefficients), top = a->levels.n - 1;
    const long parts = (long)((a->n_coefficients + PART - 1) / PART);
    const long first = (long)a->levels.first[top], end = (long)a->levels.first[top + 1];
    if (m->type == SDM_POD_I8) quantise_latent(j);
#ifdef _OPENMP
#pragma omp parallel num_threads(n_threads) if (n_threads > 1)
#else
    (void)n_threads;
#endif
    {
        size_t thread = 0;
#ifdef _OPENMP
        thread = (size_t)omp_get_thread_num();
#pragma omp for schedule(static)
#endif
        for (long i = 0; i < parts; i++) {
            const size_t o = (size_t)i * PART;
            head_product(j, o, smaller(PART, a->n_coefficients - o), ldc);
        }
#ifdef _OPENMP
#pragma omp for schedule(dynamic)
#endif
        for (long b = first; b < end; b++)
            for (size_t r = 0; r < j->rows; r += GROUP) {
                const job g = group_of(j, r);
                const size_t at = m->blocks[b].coefficient;
                decode_block(&g, (size_t)b, top, thread,
                             ready(&g, top, at, m->blocks[b].rank, thread, j->w->c + r * ldc + at, ldc));
            }
    }
}

size_t sdm_pod_scratch_bytes(const sdm_model *m, size_t n, int n_threads)
{
    workspace w;
    return carve(m->network, smaller(n, ROWS), n_threads, NULL, &w);
}

void sdm_pod_forward(const sdm_model *m, const double *params, size_t n, float *values, void *scratch, int n_threads)
{
    const pod_network *k = m->network;
    const size_t voxels = sdm_grid_count(&m->info.grid);
    for (size_t at = 0; at < n; at += ROWS) {
        const size_t rows = smaller(ROWS, n - at);
        workspace w;
        carve(k, smaller(n, ROWS), n_threads, scratch, &w);
        float *maps[ROWS];
        for (size_t r = 0; r < rows; r++) maps[r] = values + (at + r) * voxels;
        sdm_pod_latent(m, params + at * k->arch.n_params, rows, 0, NULL, &w.latent, w.z);
        decode(&(job){&m->info.grid, k, rows, rows, maps, &w}, n_threads);
    }
}

// the map and its derivatives along direction[n][P]
static void tangents(const sdm_model *m, const double *params, size_t n, const double *direction, float *values,
                     float *tangent, void *scratch, int n_threads)
{
    const pod_network *k = m->network;
    const size_t voxels = sdm_grid_count(&m->info.grid);
    workspace w;
    carve(k, 1 + n, n_threads, scratch, &w);
    sdm_pod_latent(m, params, 1, n, direction, &w.latent, w.z);
    float *maps[1 + SDM_POD_MAX_PARAMS] = {values};
    for (size_t r = 0; r < n; r++) maps[1 + r] = tangent + r * voxels;
    decode(&(job){&m->info.grid, k, 1 + n, 1, maps, &w}, n_threads);
}

size_t sdm_pod_jacobian_scratch_bytes(const sdm_model *m, int n_threads)
{
    const pod_network *k = m->network;
    workspace w;
    return carve(k, 1 + k->arch.n_params, n_threads, NULL, &w);
}

void sdm_pod_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian, void *scratch,
                      int n_threads)
{
    const size_t n = m->info.n_params;
    double unit[SDM_POD_MAX_PARAMS * SDM_POD_MAX_PARAMS] = {0};
    for (size_t i = 0; i < n; i++) unit[i * n + i] = 1;
    tangents(m, params, n, unit, values, jacobian, scratch, n_threads);
}

size_t sdm_pod_jvp_scratch_bytes(const sdm_model *m, int n_threads)
{
    workspace w;
    return carve(m->network, 2, n_threads, NULL, &w);
}

void sdm_pod_jvp(const sdm_model *m, const double *params, const double *direction, float *values, float *tangent,
                 void *scratch, int n_threads)
{
    tangents(m, params, 1, direction, values, tangent, scratch, n_threads);
}

// x[rank] = gradient at the coefficients of block b of `level`
static void back_block(const pod_network *m, const sdm_grid *g, size_t b, size_t level, const float *adjoint,
                       const workspace *w, float *x)
{
    const sdm_pod_block *k = &m->blocks[b];
    float *y = w->y[level];
    memset(y + m->outputs[b], 0, (sdm_panel_outputs(m->outputs[b]) - m->outputs[b]) * sizeof *y);
    if (level > 0) {
        const uint32_t first = m->blocks[k->child].coefficient;
        for (size_t i = k->child; i < k->child + k->n_children; i++)
            back_block(m, g, i, level - 1, adjoint, w, y + (m->blocks[i].coefficient - first));
    } else {
        const size_t line = (size_t)g->n[0];
        const float *from = adjoint + first_voxel(g, k);
        float *to = y;
        for (size_t z = 0; z < k->size[2]; z++, from += line * (size_t)g->n[1])
            for (size_t v = 0; v < k->size[1]; v++, to += k->size[0])
                memcpy(to, from + v * line, k->size[0] * sizeof *to);
    }
    if (m->type == SDM_POD_I8) {
        const float *factor = m->factor + m->coefficients_at[level] + k->coefficient;
        sdm_panel_back_i8(m->outputs[b], m->coarse[b], k->rank, (const int8_t *)m->basis + m->weights_at[b], y,
                          w->sorted);
        for (size_t i = 0; i < k->rank; i++) x[i] = factor[i] * w->sorted[i];
    } else {
        sdm_pod_product_back(m->type, m->outputs[b], k->rank, m->basis, m->weights_at[b], y, x);
    }
}

size_t sdm_pod_vjp_scratch_bytes(const sdm_model *m)
{
    workspace w;
    return carve(m->network, 2, 1, NULL, &w); // a second row of z: its gradient
}

void sdm_pod_vjp(const sdm_model *m, const double *params, const float *adjoint, double *gradient, void *scratch)
{
    const pod_network *k = m->network;
    const sdm_pod_arch *a = &k->arch;
    const size_t top = a->levels.n - 1;
    workspace w;
    carve(k, 2, 1, scratch, &w);
    sdm_pod_latent(m, params, 1, 0, NULL, &w.latent, w.z);
    for (size_t b = a->levels.first[top]; b < a->levels.first[top + 1]; b++)
        back_block(k, &m->info.grid, b, top, adjoint, &w, w.c + k->blocks[b].coefficient);
    memset(w.c + a->n_coefficients, 0, (sdm_panel_outputs(a->n_coefficients) - a->n_coefficients) * sizeof *w.c);
    float *dz = w.z + a->n_latent;
    if (k->type == SDM_POD_I8) {
        const float *factor = k->factor + k->coefficients_at[a->levels.n];
        sdm_panel_back_i8(a->n_coefficients, sdm_pod_head_coarse(k), a->n_latent, k->head, w.c, w.sorted);
        for (size_t i = 0; i < a->n_latent; i++) dz[k->order[i]] = factor[i] * w.sorted[i];
    } else {
        sdm_pod_product_back(k->type, a->n_coefficients, a->n_latent, k->head, 0, w.c, dz);
    }
    sdm_pod_latent_back(m, params, &w.latent, dz, gradient);
}
