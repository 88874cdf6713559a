/* Checks and writes the output files of a fit. */
#include <stdio.h>

#include "fit_command.h"
#include "inputs/setup.h"
#include "report/files.h"
#include "report/json_values.h"
#include "report/output.h"
#include "sdm/memory.h"

/* True for files that are written on the grid of the image. Level sets and surfaces are written in
 * the pose of the shape instead. */
static bool is_image(const char *path)
{
    return cli_ends_with_any(path, CLI_VOLUME_ENDINGS " .npy");
}

/* ---- before any work ---- */

static sdm_status check_type(const char *path, sdm_error *err)
{
    sdm_error why;
    if (cli_ends_with(path, ".json")) return SDM_OK;
    const sdm_status s = cli_check_type(path, false, &why);
    const char *more = s == SDM_E_ARG ? "; or in .json, for the result" : "";
    return s ? sdm_fail(err, s, "%s%s", why.text, more) : SDM_OK;
}

sdm_status cli_fit_check_types(const cli_args *args, sdm_error *err)
{
    const char *label = args->fit.label_out;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++) s = check_type(args->outputs.items[i], err);
    if (!s && label && !cli_ends_with_any(label, CLI_VOLUME_ENDINGS))
        s = sdm_fail(err, SDM_E_ARG,
                     "--label-out '%s': its name must end in .nii .nii.gz .nrrd or .mha", label);
    return s ? s : cli_check_vdb_options(args, err);
}

sdm_status cli_fit_check_files(const cli_args *args, sdm_error *err)
{
    const sdm_status s = cli_fit_check_types(args, err);
    return s ? s : cli_check_files(args, NULL, err);
}

/* ---- after the fit ---- */

static sdm_status write_json(const cli_fit *f, const char *path, sdm_error *err)
{
    sdm_json json = {0};
    cli_fit_json(f, &json);
    const sdm_status s = cli_json_write(&json, path, err);
    sdm_json_dispose(&json);
    return s;
}

/* Metadata of the maps of a fit. */
typedef struct map_metadata {
    const cli_fit *f;
    sdm_text params; /* "a=4.4 alpha=0.5" */
    char origin[64]; /* "model CHECKSUM" or "exact" */
} map_metadata;

static sdm_status write_map(const map_metadata *d, const char *path, const sdm_grid *g,
                            const float *values, sdm_error *err)
{
    const cli_fit *f = d->f;
    const cli_map map = {.grid = g,
                         .values = values,
                         .shape = f->shape_name,
                         .params = d->params.data,
                         .source = f->by_network ? SDM_SOURCE_NETWORK : SDM_SOURCE_EXACT,
                         .error_mm =
                             f->by_network ? sdm_model_get_info(f->model)->accuracy.rmse_mm : 0,
                         .origin = d->origin};
    return cli_write_map(path, &map, f->args, err);
}

static sdm_status write_labels(const cli_fit *f, const sdm_grid *g, const float *values,
                               sdm_error *err)
{
    const size_t n = sdm_grid_count(g);
    uint8_t *labels = NULL;
    char text[120];
    snprintf(text, sizeof text, "sdmgen %s: %s, fitted", SDM_VERSION_TEXT, f->shape_name);
    sdm_status s = SDM_ALLOC(&labels, n, "labels", err);
    for (size_t i = 0; i < n && !s; i++) labels[i] = values[i] < 0;
    if (!s) s = cli_write_labels(f->args->fit.label_out, g, labels, f->shape_name, text, err);
    sdm_free(labels);
    return s;
}

/* Writes images and labels on the grid of the image; after a fit to points, which has no image, on
 * the grid of the map. */
static sdm_status write_images(const map_metadata *d, sdm_error *err)
{
    const cli_fit *f = d->f;
    const cli_list *outputs = &f->args->outputs;
    const bool points = f->target.kind == SDM_FIT_POINTS;
    const sdm_grid *g = points ? &f->map_grid : &f->target.grid;
    bool wanted = f->args->fit.label_out;
    for (size_t i = 0; i < outputs->n; i++) wanted = wanted || is_image(outputs->items[i]);
    if (!wanted) return SDM_OK;
    float *values = points ? f->map : NULL;
    sdm_status s = points ? SDM_OK : SDM_ALLOC(&values, sdm_grid_count(g), "distance map", err);
    if (!s && !points)
        s = sdm_fit_map(&f->map_source, f->result.params, &f->result.pose, g, f->opts.n_threads,
                        values, err);
    for (size_t i = 0; i < outputs->n && !s; i++)
        if (is_image(outputs->items[i])) s = write_map(d, outputs->items[i], g, values, err);
    if (!s && f->args->fit.label_out) s = write_labels(f, g, values, err);
    if (!points) sdm_free(values);
    return s;
}

sdm_status cli_fit_write_files(const cli_fit *f, sdm_error *err)
{
    const cli_list *outputs = &f->args->outputs;
    map_metadata d = {.f = f, .origin = "exact"};
    if (f->by_network)
        snprintf(d.origin, sizeof d.origin, "model %016llx",
                 (unsigned long long)sdm_model_get_info(f->model)->checksum);
    cli_add_params(f->params, f->n_params, f->result.params, &d.params);
    sdm_status s =
        d.params.failed ? sdm_fail(err, SDM_E_NOMEM, "out of memory for the metadata") : SDM_OK;
    if (!s) s = write_images(&d, err);
    for (size_t i = 0; i < outputs->n && !s; i++) {
        const char *path = outputs->items[i];
        if (is_image(path)) continue;
        if (cli_ends_with(path, ".json"))
            s = write_json(f, path, err);
        else if (cli_is_picture(path))
            s = cli_fit_write_picture(f, path, err);
        else
            s = write_map(&d, path, &f->map_grid, f->map, err);
    }
    sdm_text_dispose(&d.params);
    return s;
}
