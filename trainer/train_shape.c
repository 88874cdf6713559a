/* Creates the shape of a configuration and checks what only the shape can tell. */
#define _XOPEN_SOURCE 700 // realpath()
#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/internal/train.h"

/* *out = the absolute folder of the configuration, to be freed with free(). */
static sdm_status find_folder(const char *file, char **out, sdm_error *err)
{
    char folder[SDM_PATH_TEXT_MAX] = ".";
    const char *slash = strrchr(file, '/');
    if (slash)
        snprintf(folder, sizeof folder, "%.*s", slash == file ? 1 : (int)(slash - file), file);
    *out = realpath(folder, NULL);
    return *out ? SDM_OK : sdm_fail(err, SDM_E_IO, "%s: %s", folder, strerror(errno));
}

/* Puts the place "file:line:column" of `mark` before the message in *err. */
static sdm_status fail_at(const sdm_config *c, sdm_mark mark, sdm_status s, sdm_error *err)
{
    char where[1200];
    return sdm_fail_in(err, s, "%s", sdm_config_where(c, mark, where));
}

/* Replaces the paths in the configuration's options by the absolute paths with which the shape was
 * created. */
static sdm_status store_absolute_paths(sdm_config *c, const sdm_instance *made, sdm_error *err)
{
    const sdm_shape *shape = sdm_instance_shape(made);
    const sdm_option_value *values = sdm_instance_options(made);
    for (size_t i = 0; i < c->shape.n_options; i++) {
        sdm_config_option *given = &c->shape.options[i];
        for (uint32_t k = 0; k < shape->n_options; k++) {
            if (shape->options[k].type != SDM_OPTION_FILE ||
                strcmp(shape->options[k].name, given->name))
                continue;
            if (strlen(values[k].text) >= sizeof given->value) {
                sdm_fail(err, SDM_E_CONFIG,
                         "option '%s': the path %.200s... is longer than %zu bytes", given->name,
                         values[k].text, sizeof given->value - 1);
                return fail_at(c, given->mark, SDM_E_CONFIG, err);
            }
            strcpy(given->value, values[k].text);
        }
    }
    return SDM_OK;
}

/* good[*n_good] = the options that the shape accepts; the others are added to *m. */
static void check_options(const sdm_config *c, const sdm_shape *shape, sdm_named_text *good,
                          size_t *n_good, sdm_mistakes *m)
{
    *n_good = 0;
    for (size_t i = 0; i < c->shape.n_options; i++) {
        const sdm_config_option *o = &c->shape.options[i];
        sdm_error why = {0};
        const sdm_status s = sdm_shape_check_option(shape, o->name, o->value, &why);
        if (s == SDM_E_NOMEM)
            sdm_mistakes_starve(m);
        else if (s)
            sdm_mistakes_add(m, o->mark, "%s", why.text);
        else
            good[(*n_good)++] = (sdm_named_text){o->name, o->value};
    }
}

/* Creates the shape with its good options and checks the ranges and distributions. */
static sdm_status create_checked(sdm_config *c, const sdm_shape *shape, sdm_instance **out,
                                 sdm_error *err)
{
    sdm_mistakes mistakes = {.file = c->file};
    sdm_named_text good[SDM_MAX_OPTIONS];
    size_t n_good;
    check_options(c, shape, good, &n_good, &mistakes);
    // without all of its options a shape may have other parameters, or none
    if (mistakes.count > 0 && (shape->create || mistakes.starved))
        return sdm_mistakes_report(&mistakes, err);
    char *folder = NULL;
    sdm_status s = find_folder(c->file, &folder, err);
    if (!s) s = sdm_instance_create(shape, good, n_good, folder, out, err);
    free(folder);
    if (s) return s;
    sdm_train_find_mistakes(c, *out, &mistakes);
    s = sdm_mistakes_report(&mistakes, err);
    return s ? s : store_absolute_paths(c, *out, err);
}

sdm_status sdm_train_shape(sdm_config *c, const sdm_shape *shape, sdm_instance **out,
                           sdm_error *err)
{
    const sdm_status s = create_checked(c, shape, out, err);
    if (s) {
        sdm_instance_free(*out);
        *out = NULL;
    }
    return s;
}
