/* Recreates the shape that a model was trained on: its options, its data files, and a check that
   its parameters agree. */
#define _POSIX_C_SOURCE 200809L // for lstat()
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/stat.h>

#include "sdm/internal/checksum.h"
#include "sdm/internal/file.h"
#include "sdm/internal/model_mesh.h"
#include "sdm/memory.h"
#include "sdm/runtime.h"

#define PATH_SIZE 4096

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

static bool ends_with_own_checksum(const char *path)
{
    uint8_t *data = NULL;
    size_t size = 0;
    const bool own = !sdm_file_read(path, UINT64_MAX, &data, &size, NULL) &&
                     sdm_crc64(0, data, size) == SDM_CRC64_WITH_OWN;
    sdm_free(data);
    return own;
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
    // earlier versions recorded the CRC-64 of all bytes, which is the same for all such files
    snprintf(found, sizeof found, "%016llx", (unsigned long long)SDM_CRC64_WITH_OWN);
    if (!strcmp(found, wanted) && ends_with_own_checksum(path)) return SDM_OK;
    return sdm_fail(err, SDM_E_FORMAT,
                    "%s: not the file '%s' of the training: its CRC-64 is not %.16s", path, option,
                    wanted);
}

/* The options of the shape, from the model file. */
typedef struct model_options {
    sdm_named_text *given;
    size_t n;
    char (*paths)[PATH_SIZE]; // [options of the model] of the data files
} model_options;

/* The checksum of the data file of an option, which follows the option; NULL: there is none. */
static const char *wanted_sum(const sdm_model_info *info, size_t option)
{
    const char *name = info->option_names[option];
    const size_t n = strlen(name);
    if (option + 1 >= info->n_options) return NULL;
    const char *next = info->option_names[option + 1];
    return !strncmp(next, name, n) && !strcmp(next + n, ".crc64") ? info->option_values[option + 1]
                                                                  : NULL;
}

/* Finds a data file in the folder of the model, and nowhere else: whoever wrote the model chose its
   name. A symbolic link would lead out of the folder. */
static sdm_status find_file(const sdm_model_info *info, size_t option, char path[PATH_SIZE],
                            sdm_error *err)
{
    const char *name = info->option_names[option], *recorded = info->option_values[option];
    const char *slash = strrchr(recorded, '/'), *wanted = wanted_sum(info, option);
    if (!info->folder)
        return sdm_fail(err, SDM_E_IO,
                        "it lies beside the file of the model, which was opened from memory");
    const char *base = slash ? slash + 1 : recorded;
    struct stat st;
    if (snprintf(path, PATH_SIZE, "%s%s", info->folder, base) >= PATH_SIZE)
        return sdm_fail(err, SDM_E_IO, "%.100s...: the name is too long", path);
    if (lstat(path, &st))
        return sdm_fail(err, SDM_E_IO, "%s: %s%s%s%s", path, strerror(errno),
                        slash ? "; models name no files elsewhere: copy " : "",
                        slash ? recorded : "", slash ? " there if you trust the model" : "");
    if (S_ISLNK(st.st_mode))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: a symbolic link, which is not followed: put the file itself there",
                        path);
    return wanted ? check_file(path, name, wanted, err) : SDM_OK;
}

static bool is_file_option(const sdm_shape *shape, const char *name)
{
    for (uint32_t i = 0; i < shape->n_options; i++)
        if (!strcmp(shape->options[i].name, name)) return shape->options[i].type == SDM_OPTION_FILE;
    return false;
}

static bool is_sum(const char *name)
{
    const char *dot = strchr(name, '.');
    return dot && !strcmp(dot, ".crc64");
}

/* Collects the options of the shape from those of the model. */
static sdm_status read_options(const sdm_model_info *info, const sdm_shape *shape, model_options *o,
                               sdm_error *err)
{
    sdm_status s = SDM_ALLOC(&o->given, info->n_options, "options", err);
    if (!s) s = SDM_ALLOC(&o->paths, info->n_options, "paths of data files", err);
    for (size_t i = 0; i < info->n_options && !s; i++) {
        sdm_named_text one = {.name = info->option_names[i], .value = info->option_values[i]};
        if (is_sum(one.name)) continue;
        if (*one.value && is_file_option(shape, one.name)) {
            s = find_file(info, i, o->paths[i], err);
            if (s) return sdm_fail_in(err, s, "data file '%s' of the exact shape", one.name);
            one.value = o->paths[i];
        }
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
            "the model was trained on shape '%s', which is not known here: load its plug-in "
            "(sdm_registry_load())",
            info->shape);
    model_options options = {0};
    sdm_instance *made = NULL;
    sdm_status s = read_options(info, shape, &options, err);
    if (!s) s = sdm_instance_create(shape, options.given, options.n, NULL, &made, err);
    if (!s) s = check_agreement(info, made, err);
    if (!s) s = sdm_model_mesh_check(info, made, err);
    sdm_free(options.paths);
    sdm_free(options.given);
    if (s)
        sdm_instance_free(made);
    else
        *out = made;
    return s;
}
