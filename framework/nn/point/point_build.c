/* Builds the file of a point network from its weights. */
#include <string.h>

#include "point_internal.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"

// writes the text that read_architecture() of point_open.c reads
static void description_write(const sdm_point_spec *spec, sdm_text *t)
{
    const sdm_point_arch *a = &spec->arch;
    sdm_model_describe(spec->info, spec->kind, t);
    sdm_text_add(t, "point.depth=%zu\n", a->depth);
    for (size_t l = 0; l < a->depth; l++)
        sdm_text_add(t, "point.width=%zu\npoint.input=%d\n", a->width[l],
                     sdm_point_takes_input(a, l));
    sdm_text_add(t, "point.activation=%d\npoint.tanh=%d\npoint.half=%d\n", a->activation,
                 a->tanh_output, spec->half);
    sdm_text_add_reals(t, "point.centre", a->centre, 3);
    sdm_text_add_real(t, "point.radius", a->radius);
    sdm_text_add_real(t, "point.scale", a->scale);
}

// fills the sections "point.hidden" and "point.input"
static void weights_pack(const sdm_point_spec *spec, void *hidden, float *input)
{
    const sdm_point_arch *a = &spec->arch;
    const float *w = spec->weights;
    size_t at[SDM_POINT_MAX_DEPTH];
    sdm_point_hidden_count(a, at);
    for (size_t l = 0; l < a->depth; l++) {
        const size_t width = a->width[l], k = sdm_point_inputs(a, l),
                     before = sdm_point_hidden(a, l);
        if (l && spec->half)
            sdm_panel_pack_f16(width, before, (sdm_view){w, k, 1}, (uint16_t *)hidden + at[l]);
        else if (l)
            sdm_panel_pack_f32(width, before, (sdm_view){w, k, 1}, (float *)hidden + at[l]);
        memcpy(input, w + width * k, width * sizeof *input);
        input += width;
        for (size_t i = before; i < k; i++)
            for (size_t o = 0; o < width; o++) *input++ = w[o * k + i];
        w += width * (k + 1);
    }
    memcpy(input, w, (a->width[a->depth - 1] + 1) * sizeof *input);
}

sdm_status sdm_point_build(const sdm_point_spec *spec, uint8_t **bytes, size_t *size,
                           sdm_error *err)
{
    const size_t weight = spec->half ? sizeof(uint16_t) : sizeof(float);
    const size_t hidden_bytes = sdm_point_hidden_count(&spec->arch, NULL) * weight;
    const size_t inputs = sdm_point_input_count(&spec->arch, NULL);
    if (strcmp(spec->kind, sdm_kind_deepsdf.name) != 0 &&
        strcmp(spec->kind, sdm_kind_imnet.name) != 0)
        return sdm_fail(err, SDM_E_ARG, "'%s' is no kind of point network; there are '%s' and '%s'",
                        spec->kind, sdm_kind_deepsdf.name, sdm_kind_imnet.name);
    uint8_t *hidden = NULL;
    float *input = NULL;
    sdm_text text = {0};
    sdm_status s = SDM_ALLOC(&hidden, hidden_bytes, "model weights", err);
    if (!s) s = SDM_ALLOC(&input, inputs, "model weights", err);
    if (!s) {
        weights_pack(spec, hidden, input);
        description_write(spec, &text);
        const sdm_section sections[] = {{"point.hidden", hidden, hidden_bytes},
                                        {"point.input", input, inputs * sizeof *input}};
        s = sdm_model_pack(spec->info, &text, sections, sizeof sections / sizeof *sections, bytes,
                           size, err);
    }
    sdm_text_dispose(&text);
    sdm_free(input);
    sdm_free(hidden);
    return s;
}
