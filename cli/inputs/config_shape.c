/* Reads the configuration of a training and creates its shape. */
#define _XOPEN_SOURCE 700 // realpath()
#include "config_shape.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "report/terminal.h"
#include "sdm/internal/box.h"
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

/* The numbers of a grid that was fitted to the shapes, in one line. */
static void tell_grid(const sdm_grid *g)
{
    const sdm_box box = sdm_box_of_grid(g);
    const double *h = g->spacing;
    char spacing[128];
    if (h[0] == h[1] && h[0] == h[2])
        snprintf(spacing, sizeof spacing, "%.4g", h[0]);
    else
        snprintf(spacing, sizeof spacing, "%.4g x %.4g x %.4g", h[0], h[1], h[2]);
    cli_notice("grid: %lld x %lld x %lld voxels of %s mm, from (%.4g, %.4g, %.4g) to (%.4g, %.4g, "
               "%.4g) mm; sdmgen config gives the reasons",
               (long long)g->n[0], (long long)g->n[1], (long long)g->n[2], spacing, box.min[0],
               box.min[1], box.min[2], box.max[0], box.max[1], box.max[2]);
}

/* Completes a grid that is to be fitted to the shapes, and tells its numbers; also the reasons for
 * them if `reasons`. */
static sdm_status fit_grid(sdm_config *c, const sdm_instance *shape, bool reasons, sdm_error *err)
{
    sdm_text line = {0};
    const sdm_status s = sdm_train_complete(c, shape, &line, err);
    if (!s && line.data && reasons)
        cli_notice("%s", line.data);
    else if (!s && line.data)
        tell_grid(&c->grid);
    sdm_text_dispose(&line);
    return s;
}

/* Finds the configured shape and creates it. */
static sdm_status make_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                             sdm_error *err)
{
    char where[1200];
    const sdm_shape *shape = cli_find_shape(r, c->shape.name, err);
    if (shape) return sdm_train_shape(c, shape, out, err);
    return sdm_fail_in(err, SDM_E_CONFIG, "%s", sdm_config_where(c, c->shape.mark, where));
}

sdm_status cli_config_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                            sdm_error *err)
{
    const sdm_status s = make_shape(c, r, out, err);
    return s ? s : fit_grid(c, *out, false, err);
}

sdm_status cli_check_memory(const sdm_config *c, const sdm_instance *shape, sdm_error *err)
{
    size_t n;
    sdm_error why = {0};
    sdm_instance_params(shape, &n);
    const sdm_status s = sdm_train_check_memory(c, n, &c->grid, &why);
    const bool fewer =
        c->network.kind == SDM_NETWORK_AUTO || c->network.kind == SDM_NETWORK_TEMPLATE;
    if (s && fewer) cli_warn("%s (network.kind: template needs less)", why.text);
    return s && !fewer ? sdm_fail(err, s, "%s", why.text) : SDM_OK;
}

/* Is `origin`, of a shape, this plug-in? The registry holds the paths without links. */
static bool is_from(const char *origin, const char *plugin)
{
    char *path = realpath(plugin, NULL);
    const bool is = !strcmp(origin, path ? path : plugin);
    free(path);
    return is;
}

/* Prints a notice if none of the files of --plugin holds the shape that the configuration names. */
static void tell_other_plugins(const cli_args *args, const sdm_registry *r, const sdm_config *c)
{
    const char *origin = "";
    sdm_text shapes = {0};
    bool given = false;
    for (size_t i = 0; i < sdm_registry_count(r); i++) {
        const char *name = sdm_registry_at(r, i)->name, *from = sdm_registry_origin(r, i);
        bool plugin = false;
        for (size_t k = 0; k < args->plugins.n; k++)
            plugin = plugin || is_from(from, args->plugins.items[k]);
        if (!strcmp(name, c->shape.name)) origin = from, given = plugin;
        if (plugin) sdm_text_add(&shapes, "%s%s", shapes.size ? ", " : "", name);
    }
    if (!given && shapes.size && !shapes.failed)
        cli_notice("shape '%s' of %s is not from --plugin, which holds %s: it is from %s",
                   c->shape.name, c->file, shapes.data,
                   !strcmp(origin, "built in") ? "the program" : origin);
    sdm_text_dispose(&shapes);
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
    if (!s) tell_other_plugins(args, *registry, *config);
    if (s) return s;
    return fit_grid(*config, *shape, args->command == &cli_commands[CLI_CONFIG], err);
}
