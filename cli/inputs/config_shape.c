/* Reads the configuration of a training and creates its shape. */
#define _XOPEN_SOURCE 700 // realpath()
#include "config_shape.h"

#include <errno.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "report/terminal.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"
#include "setup.h"

/* Reads the file files.items[0]; the key=value arguments after it, --seed and --threads override
 * its keys. *out also holds what could be read of a file with mistakes (SDM_E_CONFIG). */
static sdm_status read_config(const cli_args *args, sdm_config **out, sdm_error *err)
{
    char seed[48], threads[48];
    const char **words = NULL;
    size_t n = args->files.n - 1;
    sdm_status s = SDM_ALLOC(&words, n + 2, "overrides", err);
    if (!s) s = SDM_ALLOC(out, 1, "configuration", err);
    if (!s && n > 0)
        memcpy((void *)words, (const void *)(args->files.items + 1), n * sizeof *words);
    for (size_t i = 0; i < n && !s; i++)
        if (!strchr(words[i], '='))
            s = sdm_fail(err, SDM_E_ARG, "unexpected argument '%.200s', need key=value", words[i]);
    if (!s && args->seed >= 0) {
        snprintf(seed, sizeof seed, "seed=%lld", (long long)args->seed);
        words[n++] = seed;
    }
    if (!s && args->threads > 0) {
        snprintf(threads, sizeof threads, "threads=%lld", (long long)args->threads);
        words[n++] = threads;
    }
    if (!s) s = sdm_config_read(args->files.items[0], words, n, *out, err);
    sdm_free((void *)words);
    return s;
}

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

/* Completes a grid that is to be fitted to the shapes, and tells its numbers. */
static sdm_status fit_grid(sdm_config *c, const sdm_instance *shape, sdm_error *err)
{
    sdm_text line = {0};
    const sdm_status s = sdm_train_grid(c, shape, &line, err);
    if (!s && line.data) cli_notice("%s", line.data);
    sdm_text_dispose(&line);
    return s;
}

/* good[*n_good] = the options that the shape accepts; the others are added to *m. */
static void check_options(const sdm_config *c, const sdm_shape *shape, sdm_named_text *good,
                          size_t *n_good, sdm_mistakes *m)
{
    *n_good = 0;
    for (size_t i = 0; i < c->shape.n_options; i++) {
        const sdm_config_option *o = &c->shape.options[i];
        sdm_error why = {0};
        if (sdm_shape_check_option(shape, o->name, o->value, &why))
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
    if (mistakes.count > 0 && shape->create) return sdm_mistakes_report(&mistakes, err);
    char *folder = NULL;
    sdm_status s = find_folder(c->file, &folder, err);
    if (!s) s = sdm_instance_create(shape, good, n_good, folder, out, err);
    free(folder);
    if (s) return s;
    sdm_train_find_mistakes(c, *out, &mistakes);
    s = sdm_mistakes_report(&mistakes, err);
    return s ? s : store_absolute_paths(c, *out, err);
}

/* Finds the configured shape and creates it. */
static sdm_status make_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                             sdm_error *err)
{
    const sdm_shape *shape = cli_find_shape(r, c->shape.name, err);
    if (!shape) return fail_at(c, c->shape.mark, SDM_E_CONFIG, err);
    const sdm_status s = create_checked(c, shape, out, err);
    if (s) {
        sdm_instance_free(*out);
        *out = NULL;
    }
    return s;
}

sdm_status cli_config_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                            sdm_error *err)
{
    const sdm_status s = make_shape(c, r, out, err);
    return s ? s : fit_grid(c, *out, err);
}

static void add_lines(sdm_error *err, const char *lines)
{
    const size_t used = strlen(err->text);
    snprintf(err->text + used, sizeof err->text - used, "\n%s", lines);
}

sdm_status cli_open_config(const cli_args *args, sdm_config **config, sdm_registry **registry,
                           sdm_instance **shape, sdm_error *err)
{
    sdm_error of_shape = {0};
    const sdm_status s = read_config(args, config, err);
    // a file with mistakes: look for those in its shape as well
    if (s && !(s == SDM_E_CONFIG && (*config)->shape.name[0])) return s;
    sdm_status s_shape = cli_open_registry(args, registry, &of_shape);
    if (!s_shape) s_shape = make_shape(*config, *registry, shape, &of_shape);
    if (!s && s_shape) return sdm_fail(err, s_shape, "%s", of_shape.text);
    if (s_shape == SDM_E_CONFIG) add_lines(err, of_shape.text);
    return s ? s : fit_grid(*config, *shape, err);
}
