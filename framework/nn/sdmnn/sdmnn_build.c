/* Builds the file of an sdmnn model from its weights. */
#include <string.h>

#include "sdm/internal/kernels.h"
#include "sdm/memory.h"
#include "sdmnn_model.h"

// writes the text that read_architecture() of sdmnn_open.c reads
static void description_write(const sdm_sdmnn_spec *spec, sdm_text *t)
{
    const sdm_sdmnn_arch *a = &spec->arch;
    sdm_model_describe(spec->info, "sdmnn", t);
    sdm_text_add(t, "sdmnn.depth=%zu\nsdmnn.channels=%zu\nsdmnn.width=%zu\nsdmnn.block=%zu\n",
                 a->depth, a->channels, a->width, a->block);
    sdm_text_add(t, "sdmnn.activation=%d\nsdmnn.half=%d\n", a->activation, spec->half);
}

// stores w[n] as elements at .. at + n - 1 of `to`, which are halves or floats
static void weights_store(bool half, const float *w, size_t n, void *to, size_t at)
{
    if (!half) memcpy((float *)to + at, w, n * sizeof *w);
    for (size_t i = 0; i < n && half; i++) ((uint16_t *)to)[at + i] = sdm_half_from_float(w[i]);
}

static void sections_fill(const sdm_sdmnn_spec *spec, const sdmnn_plan *p, float *dense,
                          void *volume, void *conv)
{
    const size_t width = spec->arch.width, first = sdmnn_dense1(p);
    const float *w2 = spec->weights + first, *b2 = w2 + p->cells * width;
    memcpy(dense, spec->weights, first * sizeof *dense);
    memcpy(dense + first, b2, p->cells * sizeof *dense);
    if (spec->half)
        sdm_panel_pack_f16(p->cells, width, (sdm_view){w2, width, 1}, volume);
    else
        sdm_panel_pack_f32(p->cells, width, (sdm_view){w2, width, 1}, volume);
    float *bias = dense + first + p->cells;
    size_t at = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++) {
        if (s->op != SDMNN_CONV) continue;
        const size_t n = sdmnn_conv_weights(s);
        weights_store(spec->half, spec->weights + s->weights, n, conv, at);
        memcpy(bias, spec->weights + s->weights + n, s->conv.out * sizeof *bias);
        at += n, bias += s->conv.out;
    }
}

sdm_status sdm_sdmnn_build(const sdm_sdmnn_spec *spec, uint8_t **bytes, size_t *size,
                           sdm_error *err)
{
    sdm_status s = sdm_sdmnn_check(&spec->arch, err);
    if (s) return s;
    sdmnn_plan p;
    sdm_sdmnn_plan_make(&spec->arch, false, &p);

    // sections
    const size_t weight = spec->half ? sizeof(uint16_t) : sizeof(float);
    const size_t n_dense = sdm_sdmnn_dense_floats(&p),
                 n_volume = sdm_panel_count(p.cells, spec->arch.width),
                 n_conv = sdm_sdmnn_conv_count(&p);
    float *dense = NULL, *volume = NULL,
          *conv = NULL; // large enough for floats, also used for halves
    sdm_text text = {0};
    s = SDM_ALLOC(&dense, n_dense, "model weights", err);
    if (!s) s = SDM_ALLOC(&volume, n_volume, "model weights", err);
    if (!s) s = SDM_ALLOC(&conv, n_conv, "model weights", err);
    if (!s) {
        sections_fill(spec, &p, dense, volume, conv);
        description_write(spec, &text);
        const sdm_section sections[] = {{"sdmnn.dense", dense, n_dense * sizeof *dense},
                                        {"sdmnn.volume", volume, n_volume * weight},
                                        {"sdmnn.conv", conv, n_conv * weight}};
        s = sdm_model_pack(spec->info, &text, sections, sizeof sections / sizeof *sections, bytes,
                           size, err);
    }
    sdm_text_dispose(&text);
    sdm_free(conv);
    sdm_free(volume);
    sdm_free(dense);
    return s;
}
