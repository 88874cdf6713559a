/* Writes a network of kind sdmnn, a decoder of 3-D convolutions, as ONNX operators. Feature maps
   are [N][channels][z][y][x]. Up-sampling repeats voxels by Gather along each axis, which also cuts
   off what the level does not have. */
#include "sdm/internal/kernels.h"
#include "sdmnn_model.h"

// A convolution: index of its first weight in the section sdmnn.conv; `user` of fill_conv().
typedef struct conv_weights {
    const sdmnn_model *k;
    size_t at, row; // row: weights of one output
} conv_weights;

static void fill_volume(const void *user, size_t row, float *to)
{
    const sdmnn_model *k = user;
    const size_t n = k->plan.arch.width;
    for (size_t i = 0; i < n; i++)
        to[i] = sdm_weight_at(k->volume, k->half, sdm_panel_index(n, row, i));
}

static void fill_conv(const void *user, size_t output, float *to)
{
    const conv_weights *c = user;
    const size_t at = c->at + output * c->row;
    for (size_t i = 0; i < c->row; i++) to[i] = sdm_weight_at(c->k->conv, c->k->half, at + i);
}

// x[N][in] * w^T + bias
static sdm_onnx_value dense(sdm_onnx *g, sdm_onnx_value x, sdm_onnx_value w, size_t outputs,
                            const float *bias)
{
    sdm_onnx_set_int(g, "transB", 1);
    return sdm_onnx_node3(g, "Gemm", x, w, sdm_onnx_floats(g, "bias", 1, &outputs, bias));
}

// Repeats the voxels of a feature map along each axis; n[3]: voxels along x, y, z of the result.
static sdm_onnx_value upsample(sdm_onnx *g, sdm_onnx_value from, size_t factor, const size_t n[3])
{
    for (int a = 0; a < 3 && factor > 1; a++) {
        int32_t *index = sdm_onnx_memory(g, n[a], sizeof *index);
        if (!index) return 0;
        for (size_t i = 0; i < n[a]; i++) index[i] = (int32_t)(i / factor);
        from = sdm_onnx_gather(g, from, sdm_onnx_indices(g, "up-sampling", 1, &n[a], index), 4 - a);
    }
    return from;
}

static sdm_onnx_value convolve(const sdmnn_model *k, sdm_onnx *g, size_t step, size_t at,
                               sdm_onnx_value from)
{
    const sdmnn_step *s = &k->kept.steps[step];
    const size_t edge = s->conv.taps == 27 ? 3 : 1;
    conv_weights *user = sdm_onnx_memory(g, 1, sizeof *user);
    if (!user) return 0;
    *user = (conv_weights){k, at, s->conv.in * s->conv.taps};
    const int64_t e = (int64_t)edge, p = e / 2;
    const size_t dims[] = {s->conv.out, s->conv.in, edge, edge, edge};
    const sdm_onnx_value w = sdm_onnx_weights(g, "convolution", 5, dims, fill_conv, user),
                         bias = sdm_onnx_floats(g, "bias", 1, &s->conv.out, k->layers.bias[step]);
    sdm_onnx_set_ints(g, "kernel_shape", 3, (const int64_t[]){e, e, e});
    sdm_onnx_set_ints(g, "pads", 6, (const int64_t[]){p, p, p, p, p, p});
    const sdm_onnx_value y = sdm_onnx_node3(g, "Conv", from, w, bias);
    return s->linear ? y : sdm_onnx_activate(g, k->plan.arch.activation, y);
}

// max pooling by 2; a level of odd size has a last window of one voxel
static sdm_onnx_value pool(sdm_onnx *g, sdm_onnx_value from)
{
    sdm_onnx_set_ints(g, "kernel_shape", 3, (const int64_t[]){2, 2, 2});
    sdm_onnx_set_ints(g, "strides", 3, (const int64_t[]){2, 2, 2});
    sdm_onnx_set_int(g, "ceil_mode", 1);
    return sdm_onnx_node1(g, "MaxPool", from);
}

// The feature map at offset `at` with `channels` channels: the result of one step before `step`, or
// of two side by side. results[step]: the result of each step; first: the up-sampled volume.
static sdm_onnx_value find_map(const sdmnn_plan *p, sdm_onnx *g, size_t step, size_t at,
                               size_t channels, const sdm_onnx_value *results, sdm_onnx_value first)
{
    sdm_onnx_value parts[2] = {first, 0};
    if (at == p->input) return first;
    for (size_t i = 0; i < step; i++) {
        const sdmnn_step *s = &p->steps[i];
        if (s->to == at) parts[0] = results[i];
        if (s->op == SDMNN_UPSAMPLE && s->to == at + channels / 2 * p->level[s->level].stride)
            parts[1] = results[i];
    }
    if (!parts[1]) return parts[0];
    sdm_onnx_set_int(g, "axis", 1);
    return sdm_onnx_node(g, "Concat", 2, parts);
}

static sdm_onnx_value up_sampled_volume(const sdmnn_model *k, sdm_onnx *g, sdm_onnx_value x)
{
    const sdm_sdmnn_arch *a = &k->plan.arch;
    const size_t *c = k->plan.n_cells, first[] = {a->width, a->n_params},
                 second[] = {k->plan.cells, a->width};
    sdm_onnx_value h = dense(g, x, sdm_onnx_floats(g, "dense", 2, first, k->w1), a->width, k->b1);
    h = sdm_onnx_activate(g, a->activation, h);
    h = dense(g, h, sdm_onnx_weights(g, "dense", 2, second, fill_volume, k), k->plan.cells, k->b2);
    h = sdm_onnx_reshape(g, h, 5,
                         (const int64_t[]){-1, 1, (int64_t)c[2], (int64_t)c[1], (int64_t)c[0]});
    return upsample(g, h, a->block, a->n);
}

sdm_onnx_value sdm_sdmnn_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x)
{
    const sdmnn_model *k = m->network;
    const sdmnn_plan *p = &k->kept; // every feature map has an offset of its own
    const sdm_onnx_value first = up_sampled_volume(k, g, x);
    sdm_onnx_value results[SDMNN_STEPS] = {0};
    size_t weights = 0;
    for (size_t i = 0; i < p->n_steps; i++) {
        const sdmnn_step *s = &p->steps[i];
        const sdm_onnx_value from = find_map(p, g, i, s->from, s->conv.in, results, first);
        if (s->op == SDMNN_POOL) results[i] = pool(g, from);
        if (s->op == SDMNN_UPSAMPLE) results[i] = upsample(g, from, 2, p->level[s->level].n);
        if (s->op != SDMNN_CONV) continue;
        results[i] = convolve(k, g, i, weights, from);
        weights += sdmnn_conv_weights(s);
    }
    return sdm_model_onnx_maps(m, g, results[p->n_steps - 1]);
}
