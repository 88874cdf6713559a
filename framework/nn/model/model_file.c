/* The parts of a model file that all kinds of network share: the start of the description, packing
   into a container, and looking up sections. */
#include <string.h>

#include "model_kind.h"
#include "sdm/internal/near.h"

// read_description() of model_open.c reads these lines in the same order
void sdm_model_describe(const sdm_model_info *i, const char *kind, sdm_text *t)
{
    const sdm_accuracy *a = &i->accuracy;
    sdm_text_add(t, "kind=%s\nversion=%s\nshape=%s\n", kind, SDM_VERSION_TEXT, i->shape);

    // grid and conventions
    sdm_text_add(t, "grid.size=%lld %lld %lld\n", (long long)i->grid.n[0], (long long)i->grid.n[1],
                 (long long)i->grid.n[2]);
    sdm_text_add_reals(t, "grid.origin", i->grid.origin, 3);
    sdm_text_add_reals(t, "grid.spacing", i->grid.spacing, 3);
    sdm_text_add_reals(t, "grid.direction", i->grid.dir, 9);
    sdm_text_add(t, "unit=mm\nsign=negative inside\nframe=LPS\n");

    // parameters and options
    sdm_text_add(t, "params=%zu\n", i->n_params);
    for (size_t p = 0; p < i->n_params; p++) {
        const sdm_model_param *q = &i->params[p];
        sdm_text_add(t, "param.name=%s\nparam.unit=%s\n", q->name, q->unit);
        sdm_text_add_reals(t, "param.range", (const double[]){q->min, q->max, q->def}, 3);
        const sdm_distribution *d = &q->distribution; // a uniform one has no line
        if (d->kind == SDM_DISTRIBUTION_NORMAL)
            sdm_text_add_reals(t, "param.normal", (const double[]){d->mean, d->deviation}, 2);
    }
    sdm_text_add(t, "options=%zu\n", i->n_options);
    for (size_t o = 0; o < i->n_options; o++)
        sdm_text_add(t, "option.name=%s\noption.value=%s\n", i->option_names[o],
                     i->option_values[o]);

    // accuracy and training
    sdm_text_add(t, "accuracy.samples=%lld\n", (long long)a->samples);
    sdm_text_add_real(t, "accuracy.mse_mm2", a->mse_mm2);
    sdm_text_add_real(t, "accuracy.rmse_mm", a->rmse_mm);
    sdm_text_add_real(t, "accuracy.mae_mm", a->mae_mm);
    sdm_text_add_real(t, "accuracy.max_abs_mm", a->max_abs_mm);
    sdm_text_add_real(t, "accuracy.rmse_near_mm", a->rmse_near_mm);
    if (a->near_mm > 0 && a->near_mm != SDM_NEAR_MM_BEFORE)
        sdm_text_add_real(t, "accuracy.near_mm", a->near_mm);
    sdm_text_add_reals(t, "accuracy.quantiles_mm",
                       (const double[]){a->q50_mm, a->q90_mm, a->q99_mm}, 3);
    sdm_text_add(t, "seed=%llu\n", (unsigned long long)i->seed);
    sdm_text_add_real(t, "train.seconds", i->train_seconds);
    sdm_text_add(t, "train.samples=%lld\n", (long long)i->train_samples);
}

sdm_status sdm_model_pack(const sdm_model_info *info, const sdm_text *description,
                          const sdm_section *sections, size_t n, uint8_t **bytes, size_t *size,
                          sdm_error *err)
{
    enum { COMMON = 3 };
    const char *config = info->config ? info->config : "";
    sdm_section all[SDM_CONTAINER_MAX_SECTIONS] = {{"meta", description->data, description->size},
                                                   {"config", config, strlen(config)}};
    if (n > SDM_CONTAINER_MAX_SECTIONS - COMMON)
        return sdm_fail(err, SDM_E_INTERNAL, "%zu sections of a network, at most %d", n,
                        SDM_CONTAINER_MAX_SECTIONS - COMMON);
    sdm_text quality = {0};
    sdm_quality_describe(&info->quality, &quality);
    memcpy(all + 2, sections, n * sizeof *sections);
    n += 2;
    if (quality.size) all[n++] = (sdm_section){"quality", quality.data, quality.size};
    const sdm_status s = description->failed || quality.failed
                             ? sdm_fail(err, SDM_E_NOMEM, "no memory for the model's description")
                             : sdm_container_build(all, n, bytes, size, err);
    sdm_text_dispose(&quality);
    return s;
}

const sdm_section *sdm_section_find(const sdm_section *sections, size_t n, const char *name)
{
    for (size_t i = 0; i < n; i++)
        if (strcmp(sections[i].name, name) == 0) return &sections[i];
    return NULL;
}

/* Index of the first number that is NaN or infinite: the bits of its exponent are all set. `count`:
 * none is. */
#define FIRST_NOT_FINITE(NAME, TYPE, EXPONENT)                                                     \
    static size_t NAME(const TYPE *bits, size_t count)                                             \
    {                                                                                              \
        for (size_t at = 0; at < count;) {                                                         \
            const size_t end = count - at > 1024 ? at + 1024 : count;                              \
            size_t found = 0;                                                                      \
            for (size_t i = at; i < end; i++) found += (bits[i] & (EXPONENT)) == (EXPONENT);       \
            while (found && (bits[at] & (EXPONENT)) != (EXPONENT)) at++;                           \
            if (found) return at;                                                                  \
            at = end;                                                                              \
        }                                                                                          \
        return count;                                                                              \
    }
FIRST_NOT_FINITE(first_not_finite_16, uint16_t, UINT16_C(0x7c00))
FIRST_NOT_FINITE(first_not_finite_32, uint32_t, UINT32_C(0x7f800000))
FIRST_NOT_FINITE(first_not_finite_64, uint64_t, UINT64_C(0x7ff0000000000000))

static size_t first_not_finite(const void *data, sdm_number type, size_t count)
{
    switch (type) {
    case SDM_NUMBER_FLOAT16:
        return first_not_finite_16(data, count);
    case SDM_NUMBER_FLOAT32:
        return first_not_finite_32(data, count);
    case SDM_NUMBER_FLOAT64:
        return first_not_finite_64(data, count);
    default:
        return count;
    }
}

const void *sdm_model_weights(sdm_model *m, const sdm_section *sections, size_t n, const char *name,
                              sdm_number type, uint64_t count, sdm_error *err)
{
    static const size_t bytes[] = {[SDM_NUMBER_BYTE] = 1,
                                   [SDM_NUMBER_INT32] = 4,
                                   [SDM_NUMBER_FLOAT16] = 2,
                                   [SDM_NUMBER_FLOAT32] = 4,
                                   [SDM_NUMBER_FLOAT64] = 8};
    const sdm_section *s = sdm_section_find(sections, n, name);
    if (!s) {
        sdm_fail(err, SDM_E_FORMAT, "damaged: it has no section '%s'", name);
        return NULL;
    }
    if (s->size % bytes[type] || s->size / bytes[type] != count) {
        sdm_fail(err, SDM_E_FORMAT, "damaged: section '%s' has %zu bytes, need %llu numbers of %zu",
                 name, s->size, (unsigned long long)count, bytes[type]);
        return NULL;
    }
    const size_t bad = first_not_finite(s->data, type, (size_t)count);
    if (bad < count) {
        sdm_fail(err, SDM_E_FORMAT, "damaged: number %zu of section '%s' is not finite", bad, name);
        return NULL;
    }
    m->info.weight_bytes += s->size;
    return s->data;
}
