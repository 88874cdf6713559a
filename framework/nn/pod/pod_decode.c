/* The decoder of a pod network: latents -> coefficients -> map. It works slab by slab, so that the
   coefficients of a slab stay in the caches. Words and letters as in pod_internal.h. */
#include <string.h>

#include "pod_decode_scratch.h"
#include "sdm/internal/threads.h"

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }
static size_t padded(size_t floats) { return (floats + 15) / 16 * 16; }
static size_t top_level(const pod_network *m) { return m->arch.levels.n - 1; }

// Takes the next `floats` floats of memory[], 64-byte aligned, and advances *at. memory NULL: only
// counts.
static float *carve_floats(float *memory, size_t *at, size_t floats)
{
    float *p = memory ? memory + *at : NULL;
    *at += padded(floats);
    return p;
}

// Memory for n inputs in each of `rows` rows, and for `scales` scales. Kernels read or write up to
// SDM_PANEL elements beyond input n - 1.
static input carve_inputs(const pod_network *m, size_t rows, size_t n, size_t scales, float *memory,
                          size_t *at)
{
    input in = {.ld = padded(n + SDM_PANEL)};
    if (sdm_pod_is_integer(m))
        in.q = (int16_t *)carve_floats(memory, at, rows * in.ld / 2),
        in.scale = carve_floats(memory, at, scales);
    else
        in.x = carve_floats(memory, at, rows * in.ld);
    return in;
}

size_t sdm_pod_slab_scratch_carve(const pod_network *m, size_t rows, float *memory, slab_scratch *s)
{
    size_t at = 0;
    *s = (slab_scratch){0};
    for (size_t l = 0; l < m->arch.levels.n; l++)
        s->y[l] = carve_floats(memory, &at, rows * sdm_panel_outputs(m->max_outputs[l]));
    for (size_t l = 1; l < m->arch.levels.n && sdm_pod_is_integer(m); l++)
        s->x[l] = carve_inputs(m, rows, m->max_group[l], rows, memory, &at);
    s->leaves = carve_inputs(m, rows, m->max_slab, m->max_slab_groups * SDM_POD_ROWS, memory, &at);
    const sdm_pod_block *end = &m->blocks[m->arch.levels.first[1] - 1];
    // panels write up to 3 rows beyond the last row of a line
    s->ld_line = padded((m->arch.block * m->arch.block + 3) * (end->at[0] + end->size[0]));
    s->line = carve_floats(memory, &at, rows * s->ld_line);
    s->back = carve_floats(memory, &at, m->max_slab + SDM_PANEL);
    return at;
}

size_t sdm_pod_scratch_carve(const pod_network *m, size_t rows, int n_threads, float *memory,
                             pod_scratch *w)
{
    const sdm_pod_arch *a = &m->arch;
    size_t at = 0, most = a->n_latent;
    for (size_t l = 0; l < a->levels.n; l++)
        if (m->max_group[l] > most) most = m->max_group[l];
    *w = (pod_scratch){.ldz = padded(a->n_latent + 1)};
    w->z = carve_floats(memory, &at, rows * a->n_latent);
    w->c = carve_floats(memory, &at, (rows + 1) * sdm_panel_outputs(a->n_coefficients));
    w->sorted = carve_floats(memory, &at, sdm_pod_is_integer(m) ? most + 1 : 0);
    w->z_integers =
        (int16_t *)carve_floats(memory, &at, sdm_pod_is_integer(m) ? (rows + 1) * w->ldz / 2 : 0);
    w->z_scale = carve_floats(memory, &at, sdm_pod_is_integer(m) ? rows + 1 : 0);
    w->threads = memory ? memory + at : NULL;
    slab_scratch s;
    w->per_thread = sdm_pod_slab_scratch_carve(m, min_size(rows + 1, SDM_POD_ROWS), NULL, &s);
    return at + w->per_thread * (size_t)n_threads;
}

// Arguments for decoding one slab for up to SDM_POD_ROWS rows of sdm_pod_decode().
typedef struct slab_task {
    const pod_network *m;
    const sdm_grid *grid;
    size_t rows, with_mean;
    bool fixed, stream; // fixed: inputs are integers in units of the quanta
    float *const *maps;
    const pod_slab *slab;
    const float *z_scale; // integer weights: [rows]
    size_t residuals; // 1: one more row of inputs follows, the residual of the first row; else 0
    slab_scratch s;
} slab_task;

/* Products of blocks. */

// the inputs from number `first` on
static input input_from(input in, size_t first)
{
    if (in.x) in.x += first;
    if (in.q) in.q += first;
    return in;
}

// y[rows][ldy] = the outputs of a block whose weights begin at `at`; mean[outputs] (NULL: 0) is
// added to the first j->with_mean rows.
static void block_product(const slab_task *j, size_t outputs, size_t wide, size_t rank, size_t at,
                          const input *in, const float *mean, float *y, size_t ldy)
{
    const pod_network *m = j->m;
    const size_t rows = j->rows + j->residuals, n_mean = mean ? min_size(j->with_mean, j->rows) : 0;
    if (sdm_pod_is_integer(m)) {
        const sdm_panel_out to = {.y = y,
                                  .ld = ldy,
                                  .line = SDM_PANEL_ROW,
                                  .mean = mean,
                                  .n_mean = n_mean,
                                  .residual = j->residuals};
        sdm_panel_i8(rows, outputs, wide, rank, (const int8_t *)m->basis + at, in->q, in->ld,
                     in->scale, &to);
        return;
    }
    sdm_pod_product(m->type, rows, outputs, rank, m->basis, at, in->x, in->ld, y, ldy);
    for (size_t r = 0; r < n_mean; r++)
        for (size_t i = 0; i < outputs; i++) y[r * ldy + i] += mean[i];
}

// y[rows][ldy] = the outputs of block b, which is above level 0
static void upper_product(const slab_task *j, size_t b, const input *in, float *y, size_t ldy)
{
    const pod_network *m = j->m;
    block_product(j, m->outputs[b], m->wide ? m->wide[b] : 0, m->blocks[b].rank, m->weights_at[b],
                  in, NULL, y, ldy);
}

// Sets the scale of each row of the n integer inputs of block b and the blocks that share its
// inputs, and pads an odd n with a zero input. A row whose latents are not finite gets the scale
// NaN, because z_scale - z_scale is NaN instead of 0.
static void quantum_set(const slab_task *j, size_t b, size_t n, const input *to)
{
    for (size_t r = 0; r < j->rows; r++) {
        to->q[r * to->ld + n] = 0; // the product reads pairs of inputs
        to->scale[r] = j->m->quantum[b] + (j->z_scale[r] - j->z_scale[r]);
    }
}

// As upper_product(), but stores the outputs as integer inputs of the children, in units of the
// quanta.
static void upper_product_integers(const slab_task *j, size_t b, size_t level, const input *in,
                                   const input *to)
{
    const pod_network *m = j->m;
    const sdm_pod_block *k = &m->blocks[b];
    const sdm_panel_out out = {.integers = to->q,
                               .ld = to->ld,
                               .factor = m->to_integer + m->coefficients_at[level - 1] +
                                         m->blocks[k->child].coefficient,
                               .limit = m->limit[level - 1]};
    sdm_panel_i8(j->rows, m->outputs[b], m->wide[b], k->rank,
                 (const int8_t *)m->basis + m->weights_at[b], in->q, in->ld, in->scale, &out);
    quantum_set(j, k->child, m->outputs[b], to);
}

// *to = n coefficients of `level`, from number `first` on, as integers; their values are
// c[rows][ldc].
static void coefficients_quantise(const slab_task *j, size_t level, size_t first, size_t n,
                                  const float *c, size_t ldc, const input *to)
{
    const pod_network *m = j->m;
    const float *factor = m->factor + m->coefficients_at[level] + first;
    const int limit = m->limit[level];
    if (j->residuals)
        sdm_pod_quantise_residual(n, c, factor, limit, to->q, to->scale, to->q + j->rows * to->ld,
                                  to->scale + j->rows);
    const size_t first_row = j->residuals;
    sdm_pod_quantise_rows(j->rows - first_row, n, c + first_row * ldc, ldc, factor, limit,
                          to->q + first_row * to->ld, to->ld, to->scale + first_row);
}

// The part of j->s.leaves that holds the inputs of the leaves below block `group`.
static input inputs_of_leaves(const slab_task *j, size_t group)
{
    const pod_network *m = j->m;
    const sdm_pod_block *g = &m->blocks[group];
    const uint32_t first = m->arch.levels.n > 1 ? m->blocks[g->child].coefficient : g->coefficient;
    input in = input_from(j->s.leaves, first - j->slab->coefficient);
    if (in.scale) in.scale += (group - j->slab->group) * SDM_POD_ROWS;
    return in;
}

// Computes the inputs of all leaves below block b of `level` > 0 from the inputs of b. A product
// also writes the padding of its outputs; the next group overwrites this padding.
static void decode_upper(const slab_task *j, size_t b, size_t level, const input *in)
{
    const pod_network *m = j->m;
    const sdm_pod_block *k = &m->blocks[b];
    const uint32_t first = m->blocks[k->child].coefficient;
    const input y = {.x = j->s.y[level], .ld = sdm_panel_outputs(m->max_outputs[level])};
    const input below = level == 1              ? inputs_of_leaves(j, b)
                        : sdm_pod_is_integer(m) ? j->s.x[level - 1]
                                                : y;
    if (!sdm_pod_is_integer(m))
        upper_product(j, b, in, below.x, below.ld);
    else if (j->fixed)
        upper_product_integers(j, b, level, in, &below);
    else {
        upper_product(j, b, in, y.x, y.ld);
        coefficients_quantise(j, level - 1, first, m->outputs[b], y.x, y.ld, &below);
    }
    for (size_t i = k->child; i < k->child + k->n_children && level > 1; i++) {
        const input of_child = input_from(below, m->blocks[i].coefficient - first);
        decode_upper(j, i, level - 1, &of_child);
    }
}

// Computes the inputs of all leaves below top b from the coefficients c of the highest level.
static void decode_top(const slab_task *j, size_t b, const input *c)
{
    const pod_network *m = j->m;
    const size_t top = top_level(m), rank = m->blocks[b].rank, first = m->blocks[b].coefficient;
    const input from = input_from(*c, first), to = top == 0 ? inputs_of_leaves(j, b) : j->s.x[top];
    if (sdm_pod_is_integer(m) && !j->fixed)
        coefficients_quantise(j, top, first, rank, from.x, from.ld, &to);
    else if (top == 0 || j->fixed)
        for (size_t r = 0; r < j->rows; r++) {
            if (from.x) memcpy(to.x + r * to.ld, from.x + r * from.ld, rank * sizeof *to.x);
            if (from.q) memcpy(to.q + r * to.ld, from.q + r * from.ld, rank * sizeof *to.q);
        }
    if (j->fixed) quantum_set(j, b, rank, &to);
    if (top) decode_upper(j, b, top, sdm_pod_is_integer(m) ? &to : &from);
}

/* Decoding of leaves. The voxels of a line are collected before they are stored, so that the map is
   written in long pieces: a leaf alone has rows of only a few voxels. */

// copies n_rows contiguous rows of n voxels from y to rows that are `line` floats apart
static inline void copy_rows(size_t n, size_t n_rows, const float *y, float *to, size_t line)
{
    for (size_t v = 0; v < n_rows; v++) memcpy(to + v * line, y + v * n, n * sizeof *to);
}

// Decodes one leaf with rows of n_x voxels: the outputs go to a buffer, then into the line.
static void decode_leaf(const slab_task *j, const sdm_panel_block *p, size_t n_x)
{
    const size_t nx = (size_t)j->grid->n[0], ldy = sdm_panel_outputs(j->m->max_outputs[0]);
    float *to = j->s.line + p->y, *y = j->s.y[0];
    input in = input_from(j->s.leaves, p->x);
    if (in.scale) in.scale += p->scale;
    block_product(j, p->outputs, p->n_wide, p->k, p->weights, &in, j->m->mean + p->mean, y, ldy);
    for (size_t r = 0; r < j->rows; r++, y += ldy, to += j->s.ld_line) {
        if (n_x == 4)
            copy_rows(4, p->outputs / 4, y, to, nx);
        else
            copy_rows(n_x, p->outputs / n_x, y, to, nx);
    }
}

// Decodes one line: the n leaves from m->leaves[first] on.
static void decode_line(const slab_task *j, size_t first, size_t n)
{
    const pod_network *m = j->m;
    const sdm_panel_block *p = m->products + first, *end = p + n;
    const size_t nx = (size_t)j->grid->n[0];
    // integer kernels store rows of SDM_PANEL_ROW voxels directly into the line; the loop below
    // decodes a last leaf with shorter rows
    if (sdm_pod_is_integer(m) && m->arch.block == SDM_PANEL_ROW) {
        const size_t whole = nx / SDM_PANEL_ROW;
        const input *in = &j->s.leaves;
        const sdm_panel_out to = {.y = j->s.line,
                                  .ld = j->s.ld_line,
                                  .line = nx,
                                  .mean = m->mean,
                                  .n_mean = min_size(j->with_mean, j->rows),
                                  .residual = j->residuals};
        sdm_panel_i8_blocks(j->rows + j->residuals, whole, p, m->basis, in->q, in->ld, in->scale,
                            &to);
        p += whole;
    }
    for (; p < end; p++) decode_leaf(j, p, min_size(m->arch.block, nx - p->y));
}

// Copies the line whose first leaf is k to the maps.
static void line_store(const slab_task *j, const sdm_pod_block *k)
{
    const size_t nx = (size_t)j->grid->n[0], plane = nx * (size_t)j->grid->n[1],
                 n = k->size[1] * nx;
    size_t at = sdm_pod_first_voxel(j->grid, k) - k->at[0];
    for (size_t z = 0; z < k->size[2]; z++, at += plane)
        for (size_t r = 0; r < j->rows; r++)
            sdm_copy(n, j->s.line + r * j->s.ld_line + z * n, j->maps[r] + at, j->stream);
}

static void decode_leaves(const slab_task *j)
{
    const size_t nx = (size_t)j->grid->n[0], n = (nx + j->m->arch.block - 1) / j->m->arch.block;
    for (size_t l = j->slab->leaf; l < j->slab->leaf_end; l += n) {
        decode_line(j, l, n);
        line_store(j, &j->m->blocks[j->m->leaves[l].block]);
    }
}

// decodes one slab from the coefficients c of the highest level
static void decode_slab(const slab_task *j, const input *c)
{
    for (size_t b = j->slab->top; b < j->slab->top_end; b++) decode_top(j, b, c);
    decode_leaves(j);
}

/* The head: from the latents to the coefficients of the highest level. */

// Sets w->z_integers and w->z_scale: the latents as integers, in the order of the head's columns.
static void quantise_latent(const pod_network *m, size_t rows, size_t residuals,
                            const pod_scratch *w)
{
    const size_t latent = m->arch.n_latent, n = m->arch.levels.n;
    const float *factor = m->factor + m->coefficients_at[n];
    for (size_t r = 0; r < rows; r++) {
        int16_t *to = w->z_integers + r * w->ldz;
        for (size_t i = 0; i < latent; i++) w->sorted[i] = w->z[r * latent + m->order[i]];
        if (r < residuals)
            sdm_pod_quantise_residual(latent, w->sorted, factor, m->limit[n], to, w->z_scale,
                                      to + rows * w->ldz, w->z_scale + rows);
        else
            sdm_pod_quantise_rows(1, latent, w->sorted, 0, factor, m->limit[n], to, 0,
                                  w->z_scale + r);
    }
}

// w->c = the n coefficients of the highest level that begin at index `at`.
static void head_product(const pod_network *m, size_t rows, size_t residuals, bool fixed, size_t at,
                         size_t n, const pod_scratch *w)
{
    const size_t latent = m->arch.n_latent, wide = sdm_pod_head_wide(m), top = top_level(m);
    const size_t weights = sdm_pod_count_weights(m->type, at, wide, latent);
    const size_t ldc = sdm_panel_outputs(m->arch.n_coefficients);
    if (!sdm_pod_is_integer(m)) {
        sdm_pod_product(m->type, rows, n, latent, m->head, weights, w->z, latent, w->c + at, ldc);
        return;
    }
    const sdm_panel_out numbers = {.y = w->c + at, .ld = ldc, .line = SDM_PANEL_ROW};
    const sdm_panel_out integers = {.integers = (int16_t *)w->c + at,
                                    .ld = 2 * ldc,
                                    .factor = m->to_integer + m->coefficients_at[top] + at,
                                    .limit = m->limit[top]};
    sdm_panel_i8(rows + residuals, n, wide, latent, (const int8_t *)m->head + weights,
                 w->z_integers, w->ldz, w->z_scale, fixed ? &integers : &numbers);
    for (size_t i = at; i < at + n && residuals; i++) w->c[i] += w->c[rows * ldc + i];
}

void sdm_pod_decode(const pod_network *m, const sdm_grid *grid, size_t rows, size_t with_mean,
                    bool smooth, bool stream, float *const *maps, const pod_scratch *w,
                    int n_threads)
{
    enum { PART = 32 * SDM_PANEL };
    const bool fixed = !smooth && sdm_pod_is_integer(m);
    const size_t residuals = smooth && sdm_pod_is_integer(m) ? 1 : 0;
    const size_t coefficients = m->arch.n_coefficients, ldc = sdm_panel_outputs(coefficients);
    const long parts = (long)((coefficients + PART - 1) / PART);

    // all coefficients of the highest level, then the slabs
    if (sdm_pod_is_integer(m)) quantise_latent(m, rows, residuals, w);
#pragma omp parallel num_threads(n_threads) if (n_threads > 1)
    {
        slab_task j = {.m = m, .grid = grid, .fixed = fixed, .stream = stream};
#pragma omp for schedule(static)
        for (long i = 0; i < parts; i++) {
            const size_t o = (size_t)i * PART;
            head_product(m, rows, residuals, fixed, o, min_size(PART, coefficients - o), w);
        }

        // slabs, SDM_POD_ROWS rows at a time
        sdm_pod_slab_scratch_carve(m, min_size(rows + 1, SDM_POD_ROWS),
                                   w->threads + (size_t)sdm_thread() * w->per_thread, &j.s);
#pragma omp for schedule(dynamic)
        for (long i = 0; i < (long)m->n_slabs; i++)
            for (size_t r = 0; r < rows; r += j.rows) {
                float *from = w->c + r * ldc;
                const input c = {.x = fixed ? NULL : from,
                                 .q = fixed ? (int16_t *)from : NULL,
                                 .ld = fixed ? 2 * ldc : ldc};
                j.slab = &m->slabs[i];
                j.residuals = r == 0 ? residuals : 0;
                j.rows = min_size(SDM_POD_ROWS - j.residuals, rows - r);
                j.with_mean = with_mean > r ? with_mean - r : 0;
                j.maps = maps + r;
                j.z_scale = w->z_scale + r;
                decode_slab(&j, &c);
            }
        if (stream) sdm_copy_end();
    }
}
