/* A pod network as ONNX operators. Values are [features][N] here, N maps side by side, so that the
   weights multiply from the left.

   Blocks of a level with equal sizes are computed by one product of matrices in batches, a bucket:
   Gather collects their coefficients, [blocks][rank][N], MatMul multiplies them with their bases,
   [blocks][outputs][rank], Reshape puts the outputs in rows, [blocks * outputs][N]. The rows of all
   buckets of a level are joined. The level below gathers its coefficients from them, and the map
   its voxels. Ranks and numbers of outputs are rounded up to few sizes, with weights of zero. */
#include <stdlib.h>
#include <string.h>

#include "pod_internal.h"

// A block with its rank and number of outputs rounded up.
typedef struct place {
    uint32_t block, rank, outputs;
} place;

// Blocks places[n] of a level with equal sizes; `user` of fill_basis().
typedef struct bucket {
    const pod_network *m;
    const place *places;
    size_t n, level;
} bucket;

static size_t max_size(size_t a, size_t b) { return a > b ? a : b; }

// n >= 1 rounded up to three leading binary digits: by at most a quarter
static uint32_t round_up(size_t n)
{
    unsigned shift = 0;
    while ((n - 1) >> shift >= 8) shift++;
    const size_t unit = (size_t)1 << shift;
    return (uint32_t)((n + unit - 1) / unit * unit);
}

// w[k] = row `row` of a matrix of k columns, the first n_wide of them wide, whose panels begin at
// element `at` of `weights`
static void read_row(sdm_pod_type type, const void *weights, size_t at, size_t n_wide, size_t k,
                     size_t row, float *w)
{
    if (type == SDM_POD_I8) {
        sdm_panel_row_i8(n_wide, k, (const int8_t *)weights + at, row, w);
        return;
    }
    for (size_t i = 0; i < k; i++)
        w[i] = sdm_weight_at(weights, type == SDM_POD_F16, at + sdm_panel_index(k, row, i));
}

// weights

static void fill_layer(const void *user, size_t row, float *to)
{
    const sdm_onnx_layer *l = user;
    const pod_network *m = l->network;
    const size_t k = sdm_pod_layer_inputs(&m->arch, l->layer);
    read_row(m->type, m->layer[l->layer], 0, k, k, row, to);
    for (size_t i = 0; i < k && m->type == SDM_POD_I8; i++) to[i] *= m->layer_scale[l->layer][row];
}

// Row of the head, with its columns in the order in which they are stored.
static void fill_head(const void *user, size_t row, float *to)
{
    const pod_network *m = user;
    const size_t n = m->arch.n_latent;
    read_row(m->type, m->head, 0, sdm_pod_head_wide(m), n, row, to);
    if (m->type != SDM_POD_I8) return;
    const float *factor = m->factor + m->coefficients_at[m->arch.levels.n];
    for (size_t i = 0; i < n; i++) to[i] *= factor[i];
}

// The basis of a block as [outputs][rank], with zeros where the sizes were rounded up.
static void fill_basis(const void *user, size_t item, float *to)
{
    const bucket *b = user;
    const pod_network *m = b->m;
    const place *p = &b->places[item];
    const sdm_pod_block *k = &m->blocks[p->block];
    const size_t coefficient = m->coefficients_at[b->level] + k->coefficient;
    memset(to, 0, (size_t)p->outputs * p->rank * sizeof *to);
    for (size_t o = 0; o < m->outputs[p->block] && k->rank; o++) {
        float *row = to + o * p->rank;
        read_row(m->type, m->basis, m->weights_at[p->block], m->wide ? m->wide[p->block] : 0,
                 k->rank, o, row);
        for (size_t i = 0; i < k->rank && m->type == SDM_POD_I8; i++)
            row[i] *= m->factor[coefficient + i];
    }
}

// latents

// phi[T][N]: the polynomials of the head and of the MLP
static sdm_onnx_value polynomials(const pod_network *m, sdm_onnx *g, sdm_onnx_value x)
{
    const sdm_pod_arch *a = &m->arch;
    return sdm_onnx_polynomials(g, x, m->exponents, max_size(a->n_terms, 1 + a->n_inputs),
                                a->n_params, max_size(a->degree, a->input_degree));
}

// h[W][N]: the MLP
static sdm_onnx_value mlp(const pod_network *m, sdm_onnx *g, sdm_onnx_value h)
{
    const sdm_pod_arch *a = &m->arch;
    for (size_t l = 0; l < a->depth; l++) {
        const sdm_onnx_value w =
            sdm_onnx_layer_weights(g, a->width, sdm_pod_layer_inputs(a, l), fill_layer, m, l);
        h = sdm_onnx_node2(g, "MatMul", w, h);
        h = sdm_onnx_node2(
            g, "Add", h, sdm_onnx_floats(g, "bias", 2, (const size_t[]){a->width, 1}, m->bias[l]));
        h = sdm_onnx_activate(g, a->activation, h);
    }
    return h;
}

// coefficients[K][N] of the highest level
static sdm_onnx_value head(const pod_network *m, sdm_onnx *g, sdm_onnx_value x)
{
    const sdm_pod_arch *a = &m->arch;
    const sdm_onnx_value phi = polynomials(m, g, x);
    sdm_onnx_value z = sdm_onnx_slice(g, phi, 0, 0, (int64_t)a->n_terms);
    if (a->depth) {
        const sdm_onnx_value h = mlp(m, g, sdm_onnx_slice(g, phi, 0, 1, 1 + (int64_t)a->n_inputs));
        sdm_onnx_set_int(g, "axis", 0);
        z = sdm_onnx_node2(g, "Concat", z, h);
    }
    if (m->order)
        z = sdm_onnx_gather(g, z,
                            sdm_onnx_indices(g, "order of the head's columns", 1, &a->n_latent,
                                             (const int32_t *)m->order),
                            0);
    const size_t dims[] = {a->n_coefficients, a->n_latent};
    return sdm_onnx_node2(g, "MatMul", sdm_onnx_weights(g, "head", 2, dims, fill_head, m), z);
}

// decoder

static int compare_places(const void *x, const void *y)
{
    const place *a = x, *b = y;
    if (a->rank != b->rank) return a->rank < b->rank ? -1 : 1;
    if (a->outputs != b->outputs) return a->outputs < b->outputs ? -1 : 1;
    return a->block < b->block ? -1 : a->block > b->block;
}

// The blocks of a level, those of equal sizes side by side.
static const place *place_blocks(const pod_network *m, sdm_onnx *g, size_t level)
{
    const size_t first = m->arch.levels.first[level], n = m->arch.levels.first[level + 1] - first;
    place *p = sdm_onnx_memory(g, n, sizeof *p);
    if (!p) return NULL;
    for (size_t i = 0; i < n; i++)
        p[i] = (place){(uint32_t)(first + i), round_up(max_size(m->blocks[first + i].rank, 1)),
                       round_up(max_size(m->outputs[first + i], 1))};
    qsort(p, n, sizeof *p, compare_places);
    return p;
}

// Outputs of a bucket as rows. row_of[coefficients of the level]: the row of each in `rows`.
static sdm_onnx_value decode_bucket(const pod_network *m, sdm_onnx *g, const bucket *from,
                                    const int32_t *row_of, sdm_onnx_value rows)
{
    const size_t rank = from->places->rank, outputs = from->places->outputs;
    bucket *b = sdm_onnx_memory(g, 1, sizeof *b);
    int32_t *index = sdm_onnx_memory(g, from->n * rank, sizeof *index);
    if (!b || !index) return 0;
    *b = *from;
    for (size_t i = 0; i < b->n; i++) {
        const sdm_pod_block *k = &m->blocks[b->places[i].block];
        memcpy(index + i * rank, row_of + k->coefficient, k->rank * sizeof *index);
    }
    const sdm_onnx_value inputs = sdm_onnx_gather(
        g, rows, sdm_onnx_indices(g, "coefficients", 2, (const size_t[]){b->n, rank}, index), 0);
    const sdm_onnx_value basis =
        sdm_onnx_weights(g, "bases", 3, (const size_t[]){b->n, outputs, rank}, fill_basis, b);
    return sdm_onnx_reshape(g, sdm_onnx_node2(g, "MatMul", basis, inputs), 2,
                            (const int64_t[]){(int64_t)(b->n * outputs), -1});
}

// Joined outputs of all blocks of a level. at[blocks of the level] = the first row of each block.
static sdm_onnx_value decode_level(const pod_network *m, sdm_onnx *g, size_t level,
                                   const int32_t *row_of, sdm_onnx_value rows, int32_t *at)
{
    const size_t first = m->arch.levels.first[level], n = m->arch.levels.first[level + 1] - first;
    const place *p = place_blocks(m, g, level);
    sdm_onnx_value *parts = sdm_onnx_memory(g, n, sizeof *parts);
    if (!p || !parts) return 0;
    size_t n_parts = 0, row = 0;
    for (size_t i = 0, end; i < n; i = end) {
        for (end = i; end < n && p[end].rank == p[i].rank && p[end].outputs == p[i].outputs;
             end++) {
            at[p[end].block - first] = (int32_t)row;
            row += p[end].outputs;
        }
        const bucket b = {m, p + i, end - i, level};
        parts[n_parts++] = decode_bucket(m, g, &b, row_of, rows);
    }
    sdm_onnx_set_int(g, "axis", 0);
    return sdm_onnx_node(g, "Concat", n_parts, parts);
}

// row_of[coefficients of the level below `level`], from the first rows of its parents
static int32_t *rows_below(const pod_network *m, sdm_onnx *g, size_t level, const int32_t *at)
{
    const size_t first = m->arch.levels.first[level], end = m->arch.levels.first[level + 1];
    int32_t *row_of = sdm_onnx_memory(g, m->coefficients_at[level] - m->coefficients_at[level - 1],
                                      sizeof *row_of);
    for (size_t b = first; b < end && row_of; b++)
        for (size_t o = 0; o < m->outputs[b]; o++)
            row_of[m->blocks[m->blocks[b].child].coefficient + o] = at[b - first] + (int32_t)o;
    return row_of;
}

// The map from the rows of level 0: row_of and mean of each voxel, then [N][nz][ny][nx].
static sdm_onnx_value collect_voxels(const sdm_model *model, sdm_onnx *g, const int32_t *at,
                                     sdm_onnx_value rows)
{
    const pod_network *m = model->network;
    const sdm_grid *grid = &model->info.grid;
    const size_t n = m->arch.n_voxels, nx = (size_t)grid->n[0], ny = (size_t)grid->n[1];
    int32_t *row_of = sdm_onnx_memory(g, n, sizeof *row_of);
    float *mean = sdm_onnx_memory(g, n, sizeof *mean);
    if (!row_of || !mean) return 0;
    const float *from = m->mean;
    for (size_t i = 0; i < m->arch.levels.first[1]; i++) {
        const sdm_pod_block *k = &m->blocks[m->leaves[i].block];
        const size_t voxels = sdm_pod_block_voxels(k);
        for (size_t v = 0; v < voxels; v++) {
            const size_t x = k->at[0] + v % k->size[0], y = k->at[1] + v / k->size[0] % k->size[1],
                         z = k->at[2] + v / k->size[0] / k->size[1], voxel = (z * ny + y) * nx + x;
            row_of[voxel] = at[m->leaves[i].block] + (int32_t)v;
            mean[voxel] = from[v];
        }
        from += sdm_panel_outputs(voxels);
    }
    const sdm_onnx_value voxels =
        sdm_onnx_gather(g, rows, sdm_onnx_indices(g, "voxels", 1, &n, row_of), 0);
    const sdm_onnx_value map = sdm_onnx_node2(
        g, "Add", voxels, sdm_onnx_floats(g, "mean map", 2, (const size_t[]){n, 1}, mean));
    sdm_onnx_set_ints(g, "perm", 2, (const int64_t[]){1, 0});
    return sdm_model_onnx_maps(model, g, sdm_onnx_node1(g, "Transpose", map));
}

sdm_onnx_value sdm_pod_onnx(const sdm_model *model, sdm_onnx *g, sdm_onnx_value x)
{
    const pod_network *m = model->network;
    const sdm_pod_arch *a = &m->arch;
    int32_t *row_of = sdm_onnx_memory(g, a->n_coefficients, sizeof *row_of), *at = NULL;
    if (!row_of) return 0;
    for (size_t i = 0; i < a->n_coefficients; i++) row_of[i] = (int32_t)i;
    sdm_onnx_set_ints(g, "perm", 2, (const int64_t[]){1, 0});
    sdm_onnx_value rows = head(m, g, sdm_onnx_node1(g, "Transpose", x));
    for (size_t level = a->levels.n; level-- > 0;) {
        at = sdm_onnx_memory(g, a->levels.first[level + 1] - a->levels.first[level], sizeof *at);
        if (!at) return 0;
        rows = decode_level(m, g, level, row_of, rows, at);
        if (level) row_of = rows_below(m, g, level, at);
        if (!row_of) return 0;
    }
    return collect_voxels(model, g, at, rows);
}
