/* Opens an sdmnn model: reads architecture and weights, and checks every size before it is used. */
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "sdmnn_model.h"

static sdm_status read_architecture(sdm_model *m, sdm_lines *lines, bool *half, sdm_sdmnn_arch *a,
                                    sdm_error *err)
{
    a->n_params = m->info.n_params;
    for (int i = 0; i < 3; i++) a->n[i] = (size_t)m->info.grid.n[i];
    a->depth = (size_t)sdm_lines_int(lines, "sdmnn.depth", 1, SDM_SDMNN_MAX_DEPTH);
    a->channels = (size_t)sdm_lines_int(lines, "sdmnn.channels", 1, SDM_SDMNN_MAX_CHANNELS);
    a->width = (size_t)sdm_lines_int(lines, "sdmnn.width", 1, 65536);
    a->block = (size_t)sdm_lines_int(lines, "sdmnn.block", 1, 64);
    a->activation = (int)sdm_lines_int(lines, "sdmnn.activation", 0, 2);
    *half = sdm_lines_int(lines, "sdmnn.half", 0, 1) != 0;
    sdm_status s = sdm_lines_check(lines, err);
    if (!s && sdm_sdmnn_check(a, err)) s = sdm_fail_in(err, SDM_E_FORMAT, "damaged");
    return s;
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
    sdm_sdmnn_plan_make(&arch, false, &k->plan);
    sdm_sdmnn_plan_make(&arch, true, &k->kept);

    // sections
    const sdmnn_plan *p = &k->plan;
    const sdm_number weight = half ? SDM_NUMBER_FLOAT16 : SDM_NUMBER_FLOAT32;
    const float *dense = sdm_model_weights(m, sections, n, "sdmnn.dense", SDM_NUMBER_FLOAT32,
                                           sdm_sdmnn_dense_floats(p), err);
    if (!dense) return SDM_E_FORMAT;
    k->volume = sdm_model_weights(m, sections, n, "sdmnn.volume", weight,
                                  sdm_panel_count(p->cells, arch.width), err);
    if (!k->volume) return SDM_E_FORMAT;
    k->conv = sdm_model_weights(m, sections, n, "sdmnn.conv", weight, sdm_sdmnn_conv_count(p), err);
    if (!k->conv) return SDM_E_FORMAT;

    // parts of the section sdmnn.dense
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

    // pack the convolutions
    float *layer = NULL;
    s = SDM_ALLOC(&k->packed, sdm_sdmnn_packed_floats(p, false), "model weights", err);
    if (!s) s = SDM_ALLOC(&layer, sdm_sdmnn_largest_layer(p), "model weights", err);
    if (!s) sdm_sdmnn_pack_layers(k, false, layer, k->packed, k->layers.packed);
    sdm_free(layer);
    return s;
}

static void network_free(void *network)
{
    sdmnn_model *k = network;
    if (!k) return;
    sdm_free(k->packed);
    sdm_free(k);
}

const sdm_model_kind sdm_kind_sdmnn = {.name = "sdmnn",
                                       .open = open_network,
                                       .dispose = network_free,
                                       .scratch_bytes = sdm_sdmnn_scratch_bytes,
                                       .forward = sdm_sdmnn_model_forward,
                                       .threaded = true,
                                       .jacobian_scratch_bytes = sdm_sdmnn_jacobian_scratch_bytes,
                                       .jacobian = sdm_sdmnn_model_jacobian,
                                       .jvp_scratch_bytes = sdm_sdmnn_jvp_scratch_bytes,
                                       .jvp = sdm_sdmnn_model_jvp,
                                       .vjp_scratch_bytes = sdm_sdmnn_vjp_scratch_bytes,
                                       .vjp = sdm_sdmnn_model_vjp,
                                       .onnx = sdm_sdmnn_onnx};
