/* The output files of a fit. */
#include <stdio.h>

#include "fit_command.h"
#include "inputs/setup.h"
#include "report/files.h"
#include "report/output.h"
#include "sdm/internal/file.h"
#include "sdm/memory.h"

/* Types that lie on the grid of the image; the others have the pose of the shape. */
static bool is_image(const char *path)
{
    return cli_ends_with(path, ".nii") || cli_ends_with(path, ".nii.gz") ||
           cli_ends_with(path, ".nrrd") || cli_ends_with(path, ".mha") ||
           cli_ends_with(path, ".npy");
}

/* ---- before any work ---- */

sdm_status cli_fit_check_files(const cli_args *args, sdm_error *err)
{
    const char *label = args->fit.label_out;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        if (!cli_ends_with(args->outputs.items[i], ".json"))
            s = cli_check_type(args->outputs.items[i], false, err);
    if (!s && label && (!is_image(label) || cli_ends_with(label, ".npy")))
        s = sdm_fail(err, SDM_E_ARG,
                     "--label-out '%s': its name must end in .nii .nii.gz .nrrd or .mha", label);
    return s ? s : cli_check_files(args, NULL, err);
}

/* ---- after it ---- */

static sdm_status write_json(const cli_fit *f, const char *path, sdm_error *err)
{
    sdm_json json = {0};
    sdm_outfile *file = NULL;
    cli_fit_json(f, &json);
    sdm_status s = json.text.failed ? sdm_fail(err, SDM_E_NOMEM, "%s: no memory", path) : SDM_OK;
    if (!s) s = sdm_outfile_open(path, &file, err);
    if (!s) s = sdm_outfile_printf(file, err, "%s\n", json.text.data);
    if (!s)
        s = sdm_outfile_commit(&file, err);
    else
        sdm_outfile_discard(&file);
    sdm_json_dispose(&json);
    return s;
}

/* A map of the fit on one of its two grids, with what is known of it. */
typedef struct drawing {
    const cli_fit *f;
    sdm_text params;
    char origin[64];
} drawing;

static sdm_status write_map(const drawing *d, const char *path, const sdm_grid *g,
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
    sdm_status s = SDM_ALLOC(&labels, n, "labels", err);
    for (size_t i = 0; i < n && !s; i++) labels[i] = values[i] < 0;
    snprintf(text, sizeof text, "sdmgen %s: %s, fitted", SDM_VERSION_TEXT, f->shape_name);
    if (!s) s = sdm_volume_write(f->args->fit.label_out, g, labels, SDM_VOXEL_UINT8, text, err);
    sdm_free(labels);
    return s;
}

/* Files on the grid of the image; a fit to points has none but that of the map. */
static sdm_status write_images(const drawing *d, sdm_error *err)
{
    const cli_fit *f = d->f;
    const cli_list *outputs = &f->args->outputs;
    const bool points = f->target.kind == SDM_FIT_POINTS;
    const sdm_grid *g = points ? &f->posed : &f->target.grid;
    bool wanted = f->args->fit.label_out;
    for (size_t i = 0; i < outputs->n; i++) wanted = wanted || is_image(outputs->items[i]);
    if (!wanted) return SDM_OK;
    float *values = points ? f->map : NULL;
    sdm_status s = points ? SDM_OK : SDM_ALLOC(&values, sdm_grid_count(g), "distance map", err);
    if (!s && !points)
        s = sdm_fit_map(&f->drawn, f->result.params, &f->result.pose, g, f->opts.n_threads, values,
                        err);
    for (size_t i = 0; i < outputs->n && !s; i++)
        if (is_image(outputs->items[i])) s = write_map(d, outputs->items[i], g, values, err);
    if (!s && f->args->fit.label_out) s = write_labels(f, g, values, err);
    if (!points) sdm_free(values);
    return s;
}

sdm_status cli_fit_write_files(const cli_fit *f, sdm_error *err)
{
    const cli_list *outputs = &f->args->outputs;
    drawing d = {.f = f, .origin = "exact"};
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
        else if (cli_is_picture(path) && f->target.kind != SDM_FIT_POINTS)
            s = cli_fit_write_picture(f, path, err);
        else
            s = write_map(&d, path, &f->posed, f->map, err);
    }
    sdm_text_dispose(&d.params);
    return s;
}
