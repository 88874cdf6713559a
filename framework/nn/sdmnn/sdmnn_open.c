/* Opening of an sdmnn model: architecture and weights, every size checked before it is used. */
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "sdmnn_model.h"

size_t sdmnn_dense_floats(const sdmnn_plan *p)
{
    size_t n = sdmnn_dense1(p) + p->cells;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV) n += s->conv.out;
    return n;
}

size_t sdmnn_conv_count(const sdmnn_plan *p)
{
    size_t n = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV) n += sdmnn_conv_weights(s);
    return n;
}

static sdm_status read_architecture(sdm_model *m, sdm_lines *lines, bool *half, sdm_sdmnn_arch *a,
                                    sdm_error *err)
{
    a->n_params = m->info.n_params;
    for (int i = 0; i < 3; i++) a->n[i] = (size_t)m->info.grid.n[i];
    a->depth = (size_t)sdm_next_int(lines, "sdmnn.depth", 1, SDM_SDMNN_MAX_DEPTH);
    a->channels = (size_t)sdm_next_int(lines, "sdmnn.channels", 1, SDM_SDMNN_MAX_CHANNELS);
    a->width = (size_t)sdm_next_int(lines, "sdmnn.width", 1, 65536);
    a->block = (size_t)sdm_next_int(lines, "sdmnn.block", 1, 64);
    a->activation = (int)sdm_next_int(lines, "sdmnn.activation", 0, 2);
    *half = sdm_next_int(lines, "sdmnn.half", 0, 1) != 0;
    sdm_status s = sdm_lines_check(lines, err);
    if (!s && sdm_sdmnn_check(a, err)) s = sdm_fail_in(err, SDM_E_FORMAT, "damaged");
    return s;
}

static sdm_conv direction(const sdmnn_step *s, bool transposed)
{
    return transposed ? sdm_conv_opposite(s->conv) : s->conv;
}

size_t sdmnn_packed_floats(const sdmnn_plan *p, bool transposed)
{
    size_t n = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV)
            n += (sdm_conv_packed_count(direction(s, transposed)) + 15) / 16 * 16;
    return n;
}

size_t sdmnn_largest_layer(const sdmnn_plan *p)
{
    size_t n = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV && sdmnn_conv_weights(s) > n) n = sdmnn_conv_weights(s);
    return n;
}

void sdmnn_pack_layers(const sdmnn_model *k, bool transposed, float *layer, float *to,
                       const float **packed)
{
    const sdmnn_plan *p = &k->plan;
    size_t from = 0;
    for (size_t i = 0; i < p->n_steps; i++) {
        const sdmnn_step *s = &p->steps[i];
        if (s->op != SDMNN_CONV) continue;
        const size_t n = sdmnn_conv_weights(s);
        for (size_t j = 0; j < n && k->half; j++)
            layer[j] = sdm_half_to_float(((const uint16_t *)k->conv)[from + j]);
        sdm_conv_pack(s->conv, transposed, k->half ? layer : (const float *)k->conv + from, to);
        packed[i] = to;
        to += (sdm_conv_packed_count(direction(s, transposed)) + 15) / 16 * 16;
        from += n;
    }
}

static sdm_status open_network(sdm_model *m, sdm_lines *lines, const sdm_section *sections,
                               size_t n, sdm_error *err)
{
    sdmnn_model *k = NULL;
    sdm_sdmnn_arch arch = {0};
    bool half;
    sdm_status s = read_architecture(m, lines, &half, &arch, err);
    if (!s) s = SDM_ALLOC(&k, 1, "model", err);
    if (s) return s;
    m->network = k;
    k->half = half;
    k->layers.backend = sdm_conv_native();
    sdmnn_plan_make(&arch, false, &k->plan);
    sdmnn_plan_make(&arch, true, &k->kept);
    const sdmnn_plan *p = &k->plan;
    const size_t weight = half ? sizeof(uint16_t) : sizeof(float);
    const float *dense = sdm_model_weights(m, sections, n, "sdmnn.dense",
                                           sdmnn_dense_floats(p) * sizeof(float), err);
    if (!dense) return SDM_E_FORMAT;
    k->volume = sdm_model_weights(m, sections, n, "sdmnn.volume",
                                  sdm_panel_count(p->cells, arch.width) * weight, err);
    if (!k->volume) return SDM_E_FORMAT;
    k->conv = sdm_model_weights(m, sections, n, "sdmnn.conv", sdmnn_conv_count(p) * weight, err);
    if (!k->conv) return SDM_E_FORMAT;
    k->w1 = dense;
    k->b1 = k->w1 + arch.width * arch.n_params;
    k->b2 = k->b1 + arch.width;
    const float *bias = k->b2 + p->cells;
    for (size_t i = 0; i < p->n_steps; i++) {
        if (p->steps[i].op != SDMNN_CONV) continue;
        k->layers.bias[i] = bias;
        bias += p->steps[i].conv.out;
    }
    m->info.macs = sdm_sdmnn_work(&arch);
    float *layer = NULL;
    s = SDM_ALLOC(&k->packed, sdmnn_packed_floats(p, false), "model weights", err);
    if (!s) s = SDM_ALLOC(&layer, sdmnn_largest_layer(p), "model weights", err);
    if (!s) sdmnn_pack_layers(k, false, layer, k->packed, k->layers.packed);
    sdm_free(layer);
    return s;
}

static void dispose(void *network)
{
    sdmnn_model *k = network;
    if (!k) return;
    sdm_free(k->packed);
    sdm_free(k);
}

const sdm_model_kind sdm_kind_sdmnn = {.name = "sdmnn",
                                       .open = open_network,
                                       .dispose = dispose,
                                       .scratch_bytes = sdmnn_scratch_bytes,
                                       .forward = sdmnn_model_forward,
                                       .threaded = true,
                                       .jacobian_scratch_bytes = sdmnn_jacobian_scratch_bytes,
                                       .jacobian = sdmnn_model_jacobian,
                                       .jvp_scratch_bytes = sdmnn_jvp_scratch_bytes,
                                       .jvp = sdmnn_model_jvp,
                                       .vjp_scratch_bytes = sdmnn_vjp_scratch_bytes,
                                       .vjp = sdmnn_model_vjp};
