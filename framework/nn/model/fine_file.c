/* The section `fine` of a model file. Little-endian: width, inputs, outputs (u32), threshold
   (float32), then the weights (float32). */
#include <math.h>
#include <string.h>

#include "model_kind.h"
#include "sdm/memory.h"

enum { HEAD = 16 };
#define SECTION "fine"

static uint32_t read_u32(const uint8_t *at)
{
    return (uint32_t)at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

static void write_u32(uint32_t v, uint8_t *to)
{
    for (int b = 0; b < 4; b++) to[b] = (uint8_t)(v >> (8 * b));
}

sdm_status sdm_fine_open(sdm_model *m, const sdm_section *sections, size_t n, sdm_error *err)
{
    const sdm_section *s = sdm_section_find(sections, n, SECTION);
    if (!s) return SDM_OK;
    const uint8_t *data = s->data;
    const size_t width = s->size < HEAD ? 0 : read_u32(data);
    const bool sized = width >= 4 && width % 4 == 0 && width <= SDM_FINE_MAX_WIDTH &&
                       read_u32(data + 4) == SDM_FINE_INPUTS &&
                       read_u32(data + 8) == SDM_FINE_OUTPUTS &&
                       s->size == HEAD + sdm_fine_count(width) * sizeof(float);
    if (!sized)
        return sdm_fail(err, SDM_E_FORMAT,
                        "section " SECTION ": damaged, or made by a newer version");
    m->fine = (sdm_fine){.width = width, .weights = (const float *)(const void *)(data + HEAD)};
    memcpy(&m->fine.threshold, data + 12, sizeof m->fine.threshold);
    bool finite = isfinite(m->fine.threshold) && m->fine.threshold > 1e-6f;
    for (size_t i = 0; i < sdm_fine_count(width); i++) finite &= isfinite(m->fine.weights[i]) != 0;
    if (!finite) return sdm_fail(err, SDM_E_FORMAT, "section " SECTION ": a number is not finite");
    m->info.fine_width = width;
    m->info.weight_bytes += s->size;
    return SDM_OK;
}

const sdm_fine *sdm_model_fine(const sdm_model *m) { return m->fine.width ? &m->fine : NULL; }

sdm_status sdm_fine_attach(const uint8_t *bytes, size_t size, const sdm_fine *f, uint8_t **out,
                           size_t *out_size, sdm_error *err)
{
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS + 1];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n = 0, kept = 0;
    uint64_t checksum;
    *out = NULL;
    sdm_status s = sdm_container_parse(bytes, size, sections, names, &n, &checksum, err);
    if (s) return s;
    for (size_t i = 0; i < n; i++)
        if (strcmp(sections[i].name, SECTION) != 0) sections[kept++] = sections[i];
    const size_t weights = sdm_fine_count(f->width) * sizeof *f->weights;
    uint8_t *data = NULL;
    s = SDM_ALLOC(&data, HEAD + weights, "fine level", err);
    if (s) return s;
    write_u32((uint32_t)f->width, data);
    write_u32(SDM_FINE_INPUTS, data + 4);
    write_u32(SDM_FINE_OUTPUTS, data + 8);
    memcpy(data + 12, &f->threshold, sizeof f->threshold);
    memcpy(data + HEAD, f->weights, weights);
    sections[kept++] = (sdm_section){SECTION, data, HEAD + weights};
    s = sdm_container_build(sections, kept, out, out_size, err);
    sdm_free(data);
    return s;
}
