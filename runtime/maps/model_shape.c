/* Recreates the shape that a model was trained on: its options, its data files, and a check that
   its parameters agree. */
#include <stdio.h>
#include <string.h>

#include "sdm/internal/checksum.h"
#include "sdm/memory.h"
#include "sdm/runtime.h"

/* SDM_E_PLUGIN unless number, names and units of the parameters agree. */
static sdm_status check_agreement(const sdm_model_info *info, const sdm_instance *shape,
                                  sdm_error *err)
{
    size_t n;
    const sdm_param *p = sdm_instance_params(shape, &n);
    if (n != info->n_params)
        return sdm_fail(err, SDM_E_PLUGIN,
                        "shape '%s' has %zu parameters, the model was trained on %zu", info->shape,
                        n, info->n_params);
    for (size_t i = 0; i < n; i++) {
        if (strcmp(p[i].name, info->params[i].name) != 0)
            return sdm_fail(err, SDM_E_PLUGIN,
                            "parameter %zu of shape '%s' is '%s', the model was trained on '%s'",
                            i + 1, info->shape, p[i].name, info->params[i].name);
        if (strcmp(p[i].unit ? p[i].unit : "", info->params[i].unit) != 0)
            return sdm_fail(
                err, SDM_E_PLUGIN,
                "parameter '%s' of shape '%s' has unit '%s', the model was trained with '%s'",
                p[i].name, info->shape, p[i].unit ? p[i].unit : "", info->params[i].unit);
    }
    return SDM_OK;
}

/* SDM_E_FORMAT unless the file has checksum `wanted`: a different file would silently give a
   different shape. */
static sdm_status check_file(const char *path, const char *option, const char *wanted,
                             sdm_error *err)
{
    uint64_t crc;
    char found[20];
    const sdm_status s = sdm_file_checksum(path, &crc, err);
    if (s) return s;
    snprintf(found, sizeof found, "%016llx", (unsigned long long)crc);
    if (!strcmp(found, wanted)) return SDM_OK;
    // a model may name any file: its checksum is nobody's business
    return sdm_fail(err, SDM_E_FORMAT,
                    "%s: not the file '%s' of the training: its CRC-64 is not %.16s", path, option,
                    wanted);
}

/* The options of the shape, from the model file. */
typedef struct model_options {
    sdm_named_text *given;
    size_t n;
    char (*beside)[4096]; // [n] paths of the data files in the folder of the model
} model_options;

/* Finds the data file of the last option: in the folder of the model, or at the path it had in
   training. */
static sdm_status find_file(const sdm_model_info *info, model_options *o, const char *wanted,
                            sdm_error *err)
{
    sdm_named_text *file = &o->given[o->n - 1];
    char *beside = o->beside[o->n - 1];
    const char *slash = strrchr(file->value, '/');
    if (info->folder)
        snprintf(beside, sizeof *o->beside, "%s%s", info->folder, slash ? slash + 1 : file->value);
    if (info->folder && !check_file(beside, file->name, wanted, NULL)) {
        file->value = beside;
        return SDM_OK;
    }
    const sdm_status s = check_file(file->value, file->name, wanted, err);
    if (!s) return s;
    return sdm_fail_in(err, s, "data file '%s' of the exact shape, here or beside the model",
                       file->name);
}

/* Collects the options of the shape from those of the model. The option of a data file may be
   followed by an entry NAME.crc64 with the checksum of that file. */
static sdm_status read_options(const sdm_model_info *info, model_options *o, sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&o->given, info->n_options, "options", err);
    if (!s) s = SDM_ALLOC(&o->beside, info->n_options, "paths of data files", err);
    for (size_t i = 0; i < info->n_options && !s; i++) {
        const sdm_named_text one = {.name = info->option_names[i], .value = info->option_values[i]};
        const char *dot = strchr(one.name, '.');
        if (dot && !strcmp(dot, ".crc64") && o->n > 0)
            s = find_file(info, o, one.value, err);
        else
            o->given[o->n++] = one;
    }
    return s;
}

sdm_status sdm_runtime_instance(const sdm_model *m, const sdm_registry *r, sdm_instance **out,
                                sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "instance: a place for it is needed");
    *out = NULL;
    if (!m || !r) return sdm_fail(err, SDM_E_ARG, "instance: model and registry are needed");
    const sdm_model_info *info = sdm_model_get_info(m);
    const sdm_shape *shape = sdm_registry_find(r, info->shape, NULL);
    if (!shape)
        return sdm_fail(
            err, SDM_E_PLUGIN,
            "the model was trained on shape '%s', which is not known here; load its plug-in",
            info->shape);
    model_options options = {0};
    sdm_instance *made = NULL;
    sdm_status s = read_options(info, &options, err);
    if (!s) s = sdm_instance_create(shape, options.given, options.n, NULL, &made, err);
    if (!s) s = check_agreement(info, made, err);
    sdm_free(options.beside);
    sdm_free(options.given);
    if (s)
        sdm_instance_free(made);
    else
        *out = made;
    return s;
}
