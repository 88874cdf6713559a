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

sdm_status cli_read_config(const cli_args *args, sdm_config **out, sdm_error *err)
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
    if (s) {
        sdm_free(*out);
        *out = NULL;
    }
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

/* Returns the place in the file to report with a message: the place of the option whose quoted name
 * is in the text, else the place of the shape's name. */
static sdm_mark mark_of_message(const sdm_config *c, const char *text)
{
    for (size_t i = 0; i < c->shape.n_options; i++) {
        char quoted[SDM_NAME_MAX + 4];
        snprintf(quoted, sizeof quoted, "'%s'", c->shape.options[i].name);
        if (strstr(text, quoted)) return c->shape.options[i].mark;
    }
    return c->shape.mark;
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
            if (strlen(values[k].text) >= sizeof given->value)
                return sdm_fail(err, SDM_E_CONFIG,
                                "option '%s': the path %.200s... is longer than %zu bytes",
                                given->name, values[k].text, sizeof given->value - 1);
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

sdm_status cli_config_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                            sdm_error *err)
{
    const sdm_shape *shape = cli_find_shape(r, c->shape.name, err);
    if (!shape) return fail_at(c, c->shape.mark, SDM_E_CONFIG, err);
    sdm_named_text options[SDM_MAX_OPTIONS];
    for (size_t i = 0; i < c->shape.n_options; i++)
        options[i] = (sdm_named_text){c->shape.options[i].name, c->shape.options[i].value};
    char *folder = NULL;
    sdm_status s = find_folder(c->file, &folder, err);
    if (!s) s = sdm_instance_create(shape, options, c->shape.n_options, folder, out, err);
    free(folder);
    if (!s) s = store_absolute_paths(c, *out, err);
    if (s == SDM_E_CONFIG) return fail_at(c, mark_of_message(c, err ? err->text : ""), s, err);
    return s ? s : fit_grid(c, *out, err);
}
