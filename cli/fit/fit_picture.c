/* Draws the contour of the fitted shape over slices of the image near the shape. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fit_command.h"
#include "report/crop.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/memory.h"
#include "sdm/picture.h"

double cli_fit_interpolate(const sdm_grid *g, const float *values, const double world[3])
{
    double at[3], sum = 0;
    sdm_grid_index(g, world, at);
    for (int corner = 0; corner < 8; corner++) {
        double weight = 1;
        int64_t index[3];
        bool outside = false;
        for (int a = 0; a < 3; a++) {
            const double low = floor(at[a]), t = at[a] - low;
            const bool up = corner >> a & 1;
            outside |= !(low + up >= 0 && low + up < (double)g->n[a]);
            index[a] = outside ? 0 : (int64_t)low + up;
            weight *= up ? t : 1 - t;
        }
        if (outside) continue;
        sum += weight * (double)values[(index[2] * g->n[1] + index[1]) * g->n[0] + index[0]];
    }
    return sum;
}

/* out[g] = the reference labels on the grid of the picture, as 0.5 - label: below 0 inside. */
static void sample_reference(const cli_fit *f, const sdm_grid *g, float *out)
{
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++) {
                const double index[3] = {(double)i, (double)j, (double)k};
                double world[3];
                sdm_grid_world(g, index, world);
                *out++ = 0.5f - (float)cli_fit_interpolate(&f->reference_grid, f->reference, world);
            }
}

/* Chooses the voxels to draw: the bounding box of the shape, enlarged by half of its longest edge
 * and clipped to the image; the whole image if the shape lies outside. */
static cli_block choose_block(const cli_fit *f)
{
    sdm_box box = SDM_BOX_EMPTY;
    double longest = 0;
    sdm_box_add_mesh(&box, &f->surface);
    for (int a = 0; a < 3; a++) longest = fmax(longest, box.max[a] - box.min[a]);
    cli_block b = cli_block_of_mesh(&f->target.grid, &f->surface, 0.5 * longest);
    if (cli_block_is_empty(&b))
        b = (cli_block){{0, 0, 0}, {f->target.grid.n[0], f->target.grid.n[1], f->target.grid.n[2]}};
    return b;
}

/* The fitted map with the points. */
static sdm_status write_points(const cli_fit *f, const char *path, sdm_error *err)
{
    char title[700], verdict[FIT_WORDS_MAX];
    const char *slash = strrchr(f->path, '/');
    cli_fit_verdict_words(f, verdict);
    int used = snprintf(title, sizeof title, "%.60s, fitted%s%s\nto %.60s:", f->shape_name,
                        *verdict ? ": " : "", verdict, slash ? slash + 1 : f->path);
    for (size_t i = 0; i < f->n_params && used < (int)sizeof title; i++)
        used += snprintf(title + used, sizeof title - (size_t)used, " %s=%.4g", f->params[i].name,
                         f->result.params[i]);
    const float levels[1] = {0};
    const sdm_picture_map map = {.title = title,
                                 .values = f->map,
                                 .points = f->target.points,
                                 .n_points = f->target.n_points};
    return sdm_picture_slices(path, &f->map_grid, &map, 1, levels, 1, err);
}

sdm_status cli_fit_write_picture(const cli_fit *f, const char *path, sdm_error *err)
{
    if (f->target.kind == SDM_FIT_POINTS) return write_points(f, path, err);
    const cli_block block = choose_block(f);
    const sdm_grid g = cli_block_grid(&f->target.grid, &block);
    const size_t n = sdm_grid_count(&g);
    const bool compared = f->reference && !f->reference_is_target;
    // sample image, map and reference on the grid of the picture
    float *image = NULL, *map = NULL, *reference = NULL;
    sdm_status s = SDM_ALLOC(&image, n, "picture", err);
    if (!s) s = SDM_ALLOC(&map, n, "picture", err);
    if (!s && compared) s = SDM_ALLOC(&reference, n, "picture", err);
    if (!s)
        s = sdm_fit_map(&f->map_source, f->result.params, &f->result.pose, &g, f->opts.n_threads,
                        map, err);
    // draw them
    if (!s) {
        char title[250], fitted[120], verdict[FIT_WORDS_MAX];
        const sdm_picture_map maps[2] = {{.title = fitted, .values = map},
                                         {.title = "reference", .values = reference}};
        cli_block_copy(&f->target.grid, f->target.values, &block, image);
        if (compared) sample_reference(f, &g, reference);
        snprintf(fitted, sizeof fitted, "%s, fitted%s", f->shape_name,
                 f->doubt.status ? " (not to be trusted)" : "");
        const char *slash = strrchr(f->path, '/');
        cli_fit_verdict_words(f, verdict);
        snprintf(title, sizeof title, "%.150s%s%s", slash ? slash + 1 : f->path,
                 *verdict ? ": " : "", verdict);
        s = sdm_picture_overlay(path, &g, image, maps, compared ? 2 : 1, title, err);
    }
    sdm_free(reference);
    sdm_free(map);
    sdm_free(image);
    return s;
}
