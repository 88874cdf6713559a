/* The pod network at work: parameters -> latent -> coefficients -> map, with derivatives by forward mode. No allocation.
   Letters as in sdm/pod.h; R rows that go through the decoder together (maps, or a map and its derivatives). */
#include <string.h>

#include "model_internal.h"
#include "sdm/kernels.h"

enum { ROWS = 24 }; // four times the six rows of the kernels

static size_t pad(size_t n) { return (n + SDM_TILE - 1) / SDM_TILE * SDM_TILE; }
static size_t larger(size_t a, size_t b) { return a > b ? a : b; }
static size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

// scratch, carved from the caller's block
typedef struct workspace {
    float *z;      // [R][L]
    float *c;      // [R][pad(K)]
    float *y;      // [R][pad(V_b)]
    float *expand; // [max(L, k_b)][T]
    float *phi;    // [n_poly], all products
    float *dphi;   // [P][n_poly]
    float *h, *dh; // [1 + P][pad(W)], twice: values and tangents of a layer
    float *slope;  // [pad(W)]
} workspace;

static size_t n_poly(const sdm_model *m) { return larger(m->arch.n_terms, 1 + m->arch.n_inputs); }

static size_t carve(const sdm_model *m, size_t rows, void *memory, workspace *w)
{
    const sdm_pod_arch *a = &m->arch;
    const size_t sizes[] = {rows * a->n_latent,
                            rows * pad(a->n_coefficients),
                            rows * pad(m->max_block_voxels),
                            larger(a->n_latent, m->max_rank) * SDM_TILE,
                            n_poly(m),
                            a->n_params * n_poly(m),
                            (1 + a->n_params) * larger(pad(a->width), a->n_inputs),
                            (1 + a->n_params) * pad(a->width),
                            pad(a->width)};
    float **const fields[] = {&w->z, &w->c, &w->y, &w->expand, &w->phi, &w->dphi, &w->h, &w->dh, &w->slope};
    float *at = memory;
    size_t total = 0;
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        *fields[i] = memory ? at + total : NULL;
        total += (sizes[i] + 15) / 16 * 16;
    }
    return total * sizeof(float);
}

// z[L] at parameters p[P], and dz[P][L] (per unit of each parameter) when `tangents`; dz follows z with stride L
static void latent(const sdm_model *m, const double *p, bool tangents, const workspace *w, float *z)
{
    const sdm_pod_arch *a = &m->arch;
    const size_t rows = tangents ? 1 + a->n_params : 1, total = n_poly(m);
    double x[SDM_POD_MAX_PARAMS], unit[SDM_POD_MAX_PARAMS];
    for (size_t i = 0; i < a->n_params; i++) {
        const sdm_model_param *q = &m->params[i];
        unit[i] = 2 / (q->max - q->min);
        x[i] = (p[i] - q->min) * unit[i] - 1;
    }
    sdm_poly_eval(m->exponents, total, a->n_params, larger(a->degree, a->input_degree), x, w->phi,
                  tangents ? w->dphi : NULL);
    for (size_t r = 1; r < rows; r++)
        for (size_t t = 0; t < total; t++) w->dphi[(r - 1) * total + t] *= (float)unit[r - 1];

    for (size_t r = 0; r < rows; r++)
        memcpy(z + r * a->n_latent, r ? w->dphi + (r - 1) * total : w->phi, a->n_terms * sizeof *z);
    if (!a->depth) return;

    // the MLP: its input is the products of degree 1 and more; tangents go through the same weights, then times the slope
    const float *in = w->phi + 1, *din = w->dphi + 1;
    size_t stride = total, n_in = a->n_inputs;
    const size_t width = pad(a->width);
    float *out = w->h, *other = w->dh;
    for (size_t layer = 0; layer < a->depth; layer++) {
        for (size_t o = 0; o < width; o += SDM_TILE) {
            const float *tile = m->layer[layer] + o * n_in;
            sdm_tile_f32(1, n_in, tile, in, 0, out + o, 0);
            if (tangents) sdm_tile_f32(a->n_params, n_in, tile, din, stride, out + width + o, width);
        }
        for (size_t o = 0; o < a->width; o++) out[o] += m->bias[layer][o];
        sdm_activate(a->activation, a->width, out, out, w->slope);
        for (size_t r = 1; r < rows; r++)
            for (size_t o = 0; o < a->width; o++) out[r * width + o] *= w->slope[o];
        in = out, din = out + width, stride = width, n_in = a->width;
        float *swap = out;
        out = other, other = swap;
    }
    for (size_t r = 0; r < rows; r++) memcpy(z + r * a->n_latent + a->n_terms, in + r * width, a->width * sizeof *z);
}

static void tile(const sdm_model *m, size_t rows, size_t k, const void *weights, size_t offset, const float *x,
                 size_t ldx, float *y, size_t ldy, float *expand)
{
    if (m->half)
        sdm_tile_f16(rows, k, (const uint16_t *)weights + offset, x, ldx, y, ldy, expand);
    else
        sdm_tile_f32(rows, k, (const float *)weights + offset, x, ldx, y, ldy);
}

// block b of row r from y to its map, with the mean added when wanted
static void place(const sdm_grid *g, const sdm_pod_block *b, const float *y, const float *mean, float *map)
{
    for (size_t z = 0; z < b->size[2]; z++) {
        for (size_t v = 0; v < b->size[1]; v++) {
            const size_t from = (z * b->size[1] + v) * b->size[0];
            float *to = map + ((b->at[2] + z) * (size_t)g->n[1] + b->at[1] + v) * (size_t)g->n[0] + b->at[0];
            if (mean)
                for (size_t x = 0; x < b->size[0]; x++) to[x] = y[from + x] + mean[from + x];
            else
                memcpy(to, y + from, b->size[0] * sizeof *to);
        }
    }
}

// z[R][L] -> maps[R]; the mean is added to the first `with_mean` of them
static void decode(const sdm_model *m, size_t rows, const workspace *w, size_t with_mean, float *const *maps)
{
    const sdm_pod_arch *a = &m->arch;
    const size_t ldc = pad(a->n_coefficients), ldy = pad(m->max_block_voxels);
    for (size_t o = 0; o < ldc; o += SDM_TILE)
        tile(m, rows, a->n_latent, m->head, o * a->n_latent, w->z, a->n_latent, w->c + o, ldc, w->expand);
    size_t offset = 0;
    for (const sdm_pod_block *b = m->blocks; b < m->blocks + a->n_blocks; b++) {
        const size_t voxels = pad(sdm_pod_block_voxels(b));
        for (size_t o = 0; o < voxels; o += SDM_TILE)
            tile(m, rows, b->rank, m->basis, offset + o * b->rank, w->c + b->coefficient, ldc, w->y + o, ldy,
                 w->expand);
        for (size_t r = 0; r < rows; r++)
            place(&m->info.grid, b, w->y + r * ldy, r < with_mean ? m->mean + b->voxel : NULL, maps[r]);
        offset += voxels * b->rank;
    }
}

size_t sdm_model_scratch_bytes(const sdm_model *m, size_t n)
{
    workspace w;
    return carve(m, smaller(n, ROWS), NULL, &w);
}

void sdm_model_forward(const sdm_model *m, const double *params, size_t n, float *values, void *scratch)
{
    const size_t voxels = sdm_grid_count(&m->info.grid);
    for (size_t at = 0; at < n; at += ROWS) {
        const size_t rows = smaller(ROWS, n - at);
        workspace w;
        carve(m, smaller(n, ROWS), scratch, &w);
        float *maps[ROWS];
        for (size_t r = 0; r < rows; r++) {
            latent(m, params + (at + r) * m->arch.n_params, false, &w, w.z + r * m->arch.n_latent);
            maps[r] = values + (at + r) * voxels;
        }
        decode(m, rows, &w, rows, maps);
    }
}

size_t sdm_model_jacobian_scratch_bytes(const sdm_model *m)
{
    workspace w;
    return carve(m, 1 + m->arch.n_params, NULL, &w);
}

void sdm_model_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian, void *scratch)
{
    const size_t voxels = sdm_grid_count(&m->info.grid), rows = 1 + m->arch.n_params;
    workspace w;
    carve(m, rows, scratch, &w);
    latent(m, params, true, &w, w.z);
    float *maps[1 + SDM_POD_MAX_PARAMS];
    maps[0] = values;
    for (size_t r = 1; r < rows; r++) maps[r] = jacobian + (r - 1) * voxels;
    decode(m, rows, &w, 1, maps);
}
