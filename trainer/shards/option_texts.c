/* The options of a shape as texts. */
#include "option_texts.h"

#include <stdio.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/text.h"

void trainer_option_sums(const sdm_instance *instance, uint64_t *sums)
{
    const sdm_shape *shape = sdm_instance_shape(instance);
    const sdm_option_value *values = sdm_instance_options(instance);
    for (uint32_t i = 0; i < shape->n_options && i < SDM_MAX_OPTIONS; i++)
        if (shape->options[i].type != SDM_OPTION_FILE || !values[i].text[0] ||
            sdm_file_checksum(values[i].text, &sums[i], NULL))
            sums[i] = 0;
}

void trainer_option_texts(const sdm_instance *instance, const uint64_t *sums,
                          const char *const *file, option_texts *o)
{
    const sdm_shape *shape = sdm_instance_shape(instance);
    const sdm_option_value *v = sdm_instance_options(instance);
    for (uint32_t i = 0; i < shape->n_options && i < SDM_MAX_OPTIONS; i++) {
        const sdm_option *option = &shape->options[i];
        const bool text = option->type == SDM_OPTION_CHOICE || option->type == SDM_OPTION_FILE;
        o->names[o->n] = option->name;
        o->is_path[o->n] = sums[i] != 0;
        o->values[o->n] =
            text ? (v[i].text ? v[i].text : "") : sdm_format_real(v[i].number, o->texts[i]);
        if (option->type == SDM_OPTION_FILE && file && v[i].text && v[i].text[0])
            o->values[o->n] = file[i];
        o->n++;
        if (!sums[i]) continue;
        snprintf(o->sums[i], sizeof o->sums[i], "%s.crc64", option->name);
        snprintf(o->texts[i], sizeof o->texts[i], "%016llx", (unsigned long long)sums[i]);
        o->names[o->n] = o->sums[i];
        o->values[o->n++] = o->texts[i];
    }
}
