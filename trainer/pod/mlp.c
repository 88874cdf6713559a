/* Forward and backward pass of the perceptron of the `pod` network. */
#include "mlp.h"

#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/rng.h"

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

/* The workspace holds h[depth][B][W], slope[depth][B][W] (derivatives of the activations) and
   delta[2][B][W] (gradients of two layers in turn). */
const float *trainer_mlp_forward(const sdm_pod_arch *a, const float *weights, size_t batch,
                                 const float *x, float *workspace, int n_threads)
{
    const size_t w = a->width, layer = batch * w;
    for (size_t l = 0; l < a->depth; l++) {
        float *h = workspace + l * layer, *slope = workspace + (a->depth + l) * layer;
        const size_t k = layer_inputs(a, l);
        const float *bias = trainer_mlp_bias(a, weights, l);
        for (size_t i = 0; i < batch; i++) memcpy(h + i * w, bias, w * sizeof *h);
        sdm_gemm(batch, w, k, (sdm_view){x, k, 1},
                 (sdm_view){trainer_mlp_layer(a, weights, l), 1, k}, true, h, w, n_threads);
        sdm_activate(a->activation, layer, h, h, slope);
        x = h;
    }
    return x;
}

void trainer_mlp_backward(const sdm_pod_arch *a, const float *weights, size_t batch, const float *x,
                          float *workspace, const float *dh, float *gradient, int n_threads)
{
    const size_t w = a->width, layer = batch * w;
    float *delta[2] = {workspace + 2 * a->depth * layer, workspace + (2 * a->depth + 1) * layer};
    memcpy(delta[0], dh, layer * sizeof *dh);
    for (size_t l = a->depth; l-- > 0;) {
        float *d = delta[0];
        const float *slope = workspace + (a->depth + l) * layer,
                    *in = l ? workspace + (l - 1) * layer : x;
        const size_t k = layer_inputs(a, l), at = layer_offset(a, l);
        // gradient of matrix and bias
        for (size_t i = 0; i < layer; i++) d[i] *= slope[i];
        float *dw = gradient + at, *db = dw + k * w;
        sdm_gemm(w, k, batch, (sdm_view){d, 1, w}, (sdm_view){in, k, 1}, false, dw, k, n_threads);
        memset(db, 0, w * sizeof *db);
        for (size_t i = 0; i < batch; i++)
            for (size_t o = 0; o < w; o++) db[o] += d[i * w + o];
        // gradient of the layer below
        if (l == 0) break;
        sdm_gemm(batch, w, w, (sdm_view){d, w, 1},
                 (sdm_view){trainer_mlp_layer(a, weights, l), w, 1}, false, delta[1], w, n_threads);
        float *swap = delta[0];
        delta[0] = delta[1], delta[1] = swap;
    }
}
