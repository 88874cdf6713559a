/* The weights of an sdmnn model: sizes of its sections, and packing of its convolutions. */
#include "sdm/internal/kernels.h"
#include "sdmnn_model.h"

size_t sdm_sdmnn_dense_floats(const sdmnn_plan *p)
{
    size_t n = sdmnn_dense1(p) + p->cells;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV) n += s->conv.out;
    return n;
}

size_t sdm_sdmnn_conv_count(const sdmnn_plan *p)
{
    size_t n = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV) n += sdmnn_conv_weights(s);
    return n;
}

static sdm_conv direction(const sdmnn_step *s, bool transposed)
{
    return transposed ? sdm_conv_opposite(s->conv) : s->conv;
}

size_t sdm_sdmnn_packed_floats(const sdmnn_plan *p, bool transposed)
{
    size_t n = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV)
            n += (sdm_conv_packed_count(direction(s, transposed)) + 15) / 16 * 16;
    return n;
}

size_t sdm_sdmnn_largest_layer(const sdmnn_plan *p)
{
    size_t n = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++)
        if (s->op == SDMNN_CONV && sdmnn_conv_weights(s) > n) n = sdmnn_conv_weights(s);
    return n;
}

void sdm_sdmnn_pack_layers(const sdmnn_model *k, bool transposed, float *layer, float *to,
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
