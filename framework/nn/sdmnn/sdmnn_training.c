/* An sdmnn network in training: memory, forward pass, and gradient of the loss of a batch. */
#include <string.h>

#include "operators.h"
#include "passes.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

struct sdm_sdmnn {
    sdmnn_plan plan;
    size_t batch; /* 0: forward pass only */
    const float *weights;
    sdmnn_layers layers;
    float *packed;              /* memory of layers.packed and layers.transposed */
    float *maps, *slope, *back; /* see passes.h; slope and back only if batch > 0 */
    float *hidden, *volume;     /* outputs of the two dense layers, [B][W] and [B][cells] */
    /* [B][W] derivative of the activation of `hidden`; gradients by `hidden` and by `volume`. */
    float *hidden_slope, *dhidden, *dvolume;
    float *map, *dmap; /* [V] a map; [V] derivative of the loss by it */
};

// Number of floats that the packed weights of one layer take, rounded up to whole 64 bytes.
static size_t packed_count(const sdm_conv_backend *b, const sdmnn_step *s)
{
    return s->op == SDMNN_CONV ? (b->packed_count(s->conv) + 15) / 16 * 16 : 0;
}

static sdm_status network_allocate(sdm_sdmnn *net, sdm_error *err)
{
    sdmnn_plan *p = &net->plan;
    const sdm_conv_backend *b = net->layers.backend;
    const size_t voxels = p->arch.n[0] * p->arch.n[1] * p->arch.n[2];
    const size_t batch = net->batch ? net->batch : 1;
    size_t n = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++) {
        n += packed_count(b, s);
        if (net->batch && s->op == SDMNN_CONV)
            n += (b->packed_count(sdm_conv_opposite(s->conv)) + 15) / 16 * 16;
    }

    // memory for the forward pass, then for the gradient
    sdm_status s = SDM_ALLOC(&net->packed, n, "network weights", err);
    if (!s) s = SDM_ALLOC(&net->maps, p->floats, "network maps", err);
    if (!s) s = SDM_ALLOC(&net->hidden, batch * p->arch.width, "network maps", err);
    if (!s) s = SDM_ALLOC(&net->volume, batch * p->cells, "network maps", err);
    if (s || !net->batch) return s;
    s = SDM_ALLOC(&net->slope, p->floats, "network slopes", err);
    if (!s) s = SDM_ALLOC(&net->back, p->floats, "network gradients", err);
    if (!s) s = SDM_ALLOC(&net->hidden_slope, batch * p->arch.width, "network slopes", err);
    if (!s) s = SDM_ALLOC(&net->dhidden, batch * p->arch.width, "network gradients", err);
    if (!s) s = SDM_ALLOC(&net->dvolume, batch * p->cells, "network gradients", err);
    if (!s) s = SDM_ALLOC(&net->map, voxels, "network maps", err);
    if (!s) s = SDM_ALLOC(&net->dmap, voxels, "network maps", err);
    return s;
}

sdm_status sdm_sdmnn_create(const sdm_sdmnn_arch *a, size_t batch, const sdm_conv_backend *backend,
                            sdm_sdmnn **out, sdm_error *err)
{
    *out = NULL;
    sdm_sdmnn *net = NULL;
    sdm_status s = sdm_sdmnn_check(a, err);
    if (!s) s = SDM_ALLOC(&net, 1, "network", err);
    if (s) return s;
    sdm_sdmnn_plan_make(a, batch > 0, &net->plan);
    net->batch = batch;
    net->layers.backend = backend ? backend : sdm_conv_native();
    s = network_allocate(net, err);
    if (s)
        sdm_sdmnn_free(net);
    else
        *out = net; // SDM_ALLOC() has set the padding of the feature maps to zero
    return s;
}

void sdm_sdmnn_free(sdm_sdmnn *net)
{
    if (!net) return;
    sdm_free(net->packed);
    sdm_free(net->maps);
    sdm_free(net->slope);
    sdm_free(net->back);
    sdm_free(net->hidden);
    sdm_free(net->volume);
    sdm_free(net->hidden_slope);
    sdm_free(net->dhidden);
    sdm_free(net->dvolume);
    sdm_free(net->map);
    sdm_free(net->dmap);
    sdm_free(net);
}

void sdm_sdmnn_set(sdm_sdmnn *net, const float *weights)
{
    const sdm_conv_backend *b = net->layers.backend;
    float *at = net->packed;
    net->weights = weights;
    for (size_t i = 0; i < net->plan.n_steps; i++) {
        const sdmnn_step *s = &net->plan.steps[i];
        if (s->op != SDMNN_CONV) continue;
        const float *w = weights + s->weights;
        b->pack(s->conv, false, w, at);
        net->layers.packed[i] = at;
        net->layers.bias[i] = w + sdmnn_conv_weights(s);
        at += packed_count(b, s);
        if (!net->batch) continue;
        b->pack(s->conv, true, w, at);
        net->layers.transposed[i] = at;
        at += (b->packed_count(sdm_conv_opposite(s->conv)) + 15) / 16 * 16;
    }
}

// net->volume[B][cells] = the result of the dense layers at x[B][P]; unless NULL, slope[B][W] = the
// derivative of the activation.
static void dense(sdm_sdmnn *net, size_t batch, const float *x, float *slope, int n_threads)
{
    const sdmnn_plan *p = &net->plan;
    const size_t w = p->arch.width, in = p->arch.n_params;
    const float *w1 = net->weights, *w2 = w1 + sdmnn_dense1(p);
    sdm_dense_forward(batch, in, w, w1, w1 + w * in, x, net->hidden, n_threads);
    sdm_activate(p->arch.activation, batch * w, net->hidden, net->hidden, slope);
    sdm_dense_forward(batch, w, p->cells, w2, w2 + p->cells * w, net->hidden, net->volume,
                      n_threads);
}

// adds to the gradient by the weights of the dense layers, from net->dvolume
static void dense_backward(sdm_sdmnn *net, size_t batch, const float *x, float *gradient,
                           int n_threads)
{
    const sdmnn_plan *p = &net->plan;
    const size_t w = p->arch.width, in = p->arch.n_params, second = sdmnn_dense1(p);
    float *g1 = gradient, *g2 = gradient + second;
    sdm_dense_backward(batch, w, p->cells, net->weights + second, net->hidden, net->dvolume, g2,
                       g2 + p->cells * w, net->dhidden, n_threads);
    for (size_t i = 0; i < batch * w; i++) net->dhidden[i] *= net->hidden_slope[i];
    sdm_dense_backward(batch, in, w, net->weights, x, net->dhidden, g1, g1 + w * in, NULL,
                       n_threads);
}

void sdm_sdmnn_forward(sdm_sdmnn *net, const float *x, float *values, int n_threads)
{
    n_threads = sdm_threads(n_threads);
    dense(net, 1, x, NULL, n_threads);
    sdm_sdmnn_pass_forward(&net->plan, &net->layers, net->volume, net->maps, NULL, NULL, values,
                           n_threads);
}

double sdm_sdmnn_gradient(sdm_sdmnn *net, size_t batch, const float *x, sdm_sdmnn_loss loss,
                          void *user, uint64_t seed, uint64_t stream, uint64_t draw,
                          float *gradient, int n_threads)
{
    const sdmnn_plan *p = &net->plan;
    double sum = 0;
    n_threads = sdm_threads(n_threads);
    memset(gradient, 0, p->n_weights * sizeof *gradient);
    dense(net, batch, x, net->hidden_slope, n_threads);
    for (size_t b = 0; b < batch; b++) {
        const sdmnn_draw numbers = {seed, stream, draw + b};
        sdm_sdmnn_pass_forward(p, &net->layers, net->volume + b * p->cells, net->maps, net->slope,
                               &numbers, net->map, n_threads);
        sum += loss(user, b, net->map, net->dmap);
        sdm_sdmnn_pass_backward(p, &net->layers, net->maps, net->slope, net->dmap, net->back,
                                net->dvolume + b * p->cells, gradient, n_threads);
    }
    dense_backward(net, batch, x, gradient, n_threads);
    return sum;
}
