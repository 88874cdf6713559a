/* Forward and backward pass of the perceptron of the `pod` network. */
#include "mlp.h"

#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/team.h"

/* Number of inputs of layer l. */
static size_t layer_inputs(const sdm_pod_arch *a, size_t l) { return l ? a->width : a->n_inputs; }

/* Index of the first weight of layer l. */
static size_t layer_offset(const sdm_pod_arch *a, size_t l)
{
    size_t n = 0;
    for (size_t i = 0; i < l; i++) n += (layer_inputs(a, i) + 1) * a->width;
    return n;
}

size_t trainer_mlp_count(const sdm_pod_arch *a) { return layer_offset(a, a->depth); }
const float *trainer_mlp_layer(const sdm_pod_arch *a, const float *weights, size_t l)
{
    return weights + layer_offset(a, l);
}
const float *trainer_mlp_bias(const sdm_pod_arch *a, const float *weights, size_t l)
{
    return weights + layer_offset(a, l) + layer_inputs(a, l) * a->width;
}

void trainer_mlp_init(const sdm_pod_arch *a, uint64_t seed, float *weights)
{
    for (size_t l = 0; l < a->depth; l++) {
        const size_t at = layer_offset(a, l), n = layer_inputs(a, l) * a->width;
        const double sd = sqrt(2.0 / (double)layer_inputs(a, l));
        for (size_t i = 0; i < n; i++)
            weights[at + i] = (float)(sd * sdm_rng_normal(seed, STREAM_INIT, at + i));
        memset(weights + at + n, 0, a->width * sizeof *weights);
    }
}

size_t trainer_mlp_workspace(const sdm_pod_arch *a, size_t batch)
{
    return (2 * a->depth + 2) * batch * a->width;
}

/* Rows or columns of a batch that a thread computes at a time. */
enum { ROWS = 16, COLUMNS = 32 };

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }

/* A loop over slices of one layer. */
typedef struct layer_loop {
    const sdm_pod_arch *arch;
    size_t batch;
    const float *bias;
    float *h, *slope;
    const float *dh; // gradient by h
    float *delta;    // gradient by the inputs of the activations
    float *db;       // gradient by the bias
} layer_loop;

/* h = activation(h + bias), and its slope, in rows index * ROWS and up. */
static void activate_rows(void *user, size_t index, int member)
{
    const layer_loop *l = user;
    const size_t w = l->arch->width, first = index * ROWS, n = min_size(ROWS, l->batch - first);
    float *restrict h = l->h + first * w;
    const float *restrict bias = l->bias;
    (void)member;
    for (size_t i = 0; i < n; i++)
        for (size_t o = 0; o < w; o++) h[i * w + o] += bias[o];
    sdm_activate(l->arch->activation, n * w, h, h, l->slope + first * w);
}

/* delta = dh * slope, and its sums over the batch, in columns index * COLUMNS and up. */
static void deactivate_columns(void *user, size_t index, int member)
{
    const layer_loop *l = user;
    const size_t w = l->arch->width, first = index * COLUMNS, n = min_size(COLUMNS, w - first);
    float sum[COLUMNS] = {0};
    (void)member;
    for (size_t i = 0; i < l->batch; i++) {
        const size_t at = i * w + first;
        for (size_t o = 0; o < n; o++) {
            l->delta[at + o] = l->dh[at + o] * l->slope[at + o];
            sum[o] += l->delta[at + o];
        }
    }
    memcpy(l->db + first, sum, n * sizeof *sum);
}

/* The workspace holds h[depth][B][W], slope[depth][B][W] (derivatives of the activations) and
   two buffers [B][W] of the backward pass. */
const float *trainer_mlp_forward(const sdm_pod_arch *a, const float *weights, size_t batch,
                                 const float *x, float *workspace, int n_threads)
{
    const size_t w = a->width, layer = batch * w;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = layer_inputs(a, l);
        layer_loop loop = {.arch = a,
                           .batch = batch,
                           .bias = trainer_mlp_bias(a, weights, l),
                           .h = workspace + l * layer,
                           .slope = workspace + (a->depth + l) * layer};
        sdm_gemm(batch, w, k, (sdm_view){x, k, 1},
                 (sdm_view){trainer_mlp_layer(a, weights, l), 1, k}, false, loop.h, w, n_threads);
        sdm_team_run(n_threads, (batch + ROWS - 1) / ROWS, activate_rows, &loop);
        x = loop.h;
    }
    return x;
}

void trainer_mlp_backward(const sdm_pod_arch *a, const float *weights, size_t batch, const float *x,
                          float *workspace, const float *dh, float *gradient, int n_threads)
{
    const size_t w = a->width, layer = batch * w;
    float *delta = workspace + 2 * a->depth * layer, *below = delta + layer;
    for (size_t l = a->depth; l-- > 0;) {
        const float *in = l ? workspace + (l - 1) * layer : x;
        const size_t k = layer_inputs(a, l);
        float *dw = gradient + layer_offset(a, l);
        // gradient by the inputs of the activations, by matrix and bias
        layer_loop loop = {.arch = a,
                           .batch = batch,
                           .slope = workspace + (a->depth + l) * layer,
                           .dh = dh,
                           .delta = delta,
                           .db = dw + k * w};
        sdm_team_run(n_threads, (w + COLUMNS - 1) / COLUMNS, deactivate_columns, &loop);
        sdm_gemm(w, k, batch, (sdm_view){delta, 1, w}, (sdm_view){in, k, 1}, false, dw, k,
                 n_threads);
        // gradient by the outputs of the layer below
        if (l == 0) break;
        sdm_gemm(batch, w, w, (sdm_view){delta, w, 1},
                 (sdm_view){trainer_mlp_layer(a, weights, l), w, 1}, false, below, w, n_threads);
        dh = below;
    }
}
