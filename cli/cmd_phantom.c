/* sdmgen phantom: makes a test image of a shape, its labels and the truth. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "commands.h"
#include "phantom/phantom_command.h"
#include "report/files.h"
#include "report/json_values.h"
#include "report/output.h"
#include "report/terminal.h"
#include "sdm/image.h"
#include "sdm/memory.h"
#include "sdm/volume.h"

/* Fewer voxels inside show hardly any shape. */
enum { FEW_INSIDE = 50 };

/* ---- before any work ---- */

static sdm_status check_ending(const char *option, const char *path, const char *endings,
                               sdm_error *err)
{
    if (!path || cli_ends_with_any(path, endings)) return SDM_OK;
    return sdm_fail(err, SDM_E_ARG, "%s '%s': its name must end in %s", option, path, endings);
}

static sdm_status check_files(const cli_args *args, sdm_error *err)
{
    const char *label = args->phantom.label, *truth = args->phantom.truth,
               *surface = args->phantom.surface;
    if (args->outputs.n == 0 && !label && !truth && !surface && !args->json)
        return sdm_fail(
            err, SDM_E_ARG,
            "phantom: an output is needed: -o FILE, --label, --surface, --truth or --json");
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = check_ending("output", args->outputs.items[i], CLI_VOLUME_ENDINGS " .npy", err);
    if (!s) s = check_ending("--label", label, CLI_VOLUME_ENDINGS, err);
    if (!s) s = check_ending("--truth", truth, ".json", err);
    if (!s) s = check_ending("--surface", surface, CLI_MESH_ENDINGS " .csv .npy", err);
    return s ? s : cli_check_files(args, NULL, err);
}

/* ---- output ---- */

/* out[n] = values[n] rounded and clipped to int16; *clipped: the number of clipped values. */
static void round_to_int16(const float *values, size_t n, int16_t *out, size_t *clipped)
{
    *clipped = 0;
    for (size_t i = 0; i < n; i++) {
        const float v = roundf(values[i]);
        *clipped += v < INT16_MIN || v > INT16_MAX;
        out[i] = (int16_t)fminf(fmaxf(v, INT16_MIN), INT16_MAX);
    }
}

static sdm_status write_images(const cli_phantom *p, const float *values, const char *text,
                               sdm_error *err)
{
    const cli_list *outputs = &p->args->outputs;
    const bool whole = !strcmp(p->args->phantom.type, "int16");
    size_t clipped = 0;
    int16_t *rounded = NULL;
    sdm_status s = whole ? SDM_ALLOC(&rounded, sdm_grid_count(&p->grid), "image", err) : SDM_OK;
    if (!s && whole) round_to_int16(values, sdm_grid_count(&p->grid), rounded, &clipped);
    if (clipped)
        cli_notice("%zu values do not fit in int16 and were clipped; --type float32 keeps them",
                   clipped);
    for (size_t i = 0; i < outputs->n && !s; i++) {
        const char *path = outputs->items[i];
        if (cli_ends_with(path, ".npy"))
            s = sdm_image_write(path, &p->grid, values, text, err);
        else if (whole)
            s = sdm_volume_write(path, &p->grid, rounded, SDM_VOXEL_INT16, text, err);
        else
            s = sdm_volume_write(path, &p->grid, values, SDM_VOXEL_FLOAT32, text, err);
    }
    sdm_free(rounded);
    return s;
}

/* Writes the truth to the file of --truth and, with --json, to stdout. */
static sdm_status write_truth(const cli_phantom *p, size_t inside, sdm_error *err)
{
    const char *path = p->args->phantom.truth;
    sdm_json json = {0};
    cli_phantom_truth(p, inside, &json);
    sdm_status s = path ? cli_json_write(&json, path, err) : SDM_OK;
    if (!s && p->args->json) return cli_print_json(&json, err);
    sdm_json_dispose(&json);
    return s;
}

static sdm_status make_image(const cli_phantom *p, sdm_error *err)
{
    const cli_args *args = p->args;
    const size_t n = sdm_grid_count(&p->grid);
    float *values = NULL;
    uint8_t *label = NULL;
    size_t inside = 0;
    char text[200];
    snprintf(text, sizeof text, "sdmgen %s phantom of %s, seed %llu", SDM_VERSION_TEXT, args->shape,
             (unsigned long long)p->opts.seed);
    sdm_status s = args->outputs.n ? SDM_ALLOC(&values, n, "image", err) : SDM_OK;
    if (!s) s = SDM_ALLOC(&label, n, "labels", err);
    if (!s)
        s = sdm_phantom_make(p->shape.instance, p->shape.values, &p->pose, &p->opts, &p->grid,
                             values, label, err);
    if (!s) s = cli_check_interrupt(err);
    for (size_t i = 0; i < n && !s; i++) inside += label[i];
    if (!s && !inside) cli_warn("no voxel is inside the shape: does the grid cover it?");
    if (!s && inside > 0 && inside < FEW_INSIDE && !p->thin)
        cli_warn("only %zu voxel%s inside the shape: smaller ones (--spacing) show it", inside,
                 inside == 1 ? " is" : "s are");
    if (!s && p->cut && !isnan(args->phantom.crop[0]))
        cli_notice("the shape leaves the field of view");
    if (!s && values) s = write_images(p, values, text, err);
    if (!s && args->phantom.label)
        s = cli_write_labels(args->phantom.label, &p->grid, label, args->shape, text, err);
    if (!s) s = write_truth(p, inside, err);
    if (!s) cli_phantom_summary(p, inside);
    sdm_free(label);
    sdm_free(values);
    return s;
}

/* Is anything wanted but the surface? */
static bool wants_image(const cli_args *args)
{
    return args->outputs.n > 0 || args->phantom.label || args->phantom.truth || args->json;
}

sdm_status cmd_phantom(const cli_args *args, sdm_error *err)
{
    if (!args->shape) return sdm_fail(err, SDM_E_ARG, "phantom: --shape NAME is needed");
    cli_phantom p = {.args = args};
    sdm_status s = check_files(args, err);
    if (!s) s = cli_phantom_setup(&p, err);
    if (!s && wants_image(args)) s = make_image(&p, err);
    if (!s) s = cli_phantom_surface(&p, err);
    cli_shape_dispose(&p.shape);
    return s;
}
