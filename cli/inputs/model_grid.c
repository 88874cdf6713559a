/* The grid of the maps that `generate` makes: that of the model, or another one in its box. */
#include <math.h>
#include <string.h>

#include "setup.h"

/* The centre of the box of the voxel centres of a grid, and its edges (mm) along the axes. */
static void box_of(const sdm_grid *g, double centre[3], double edge[3])
{
    double middle[3];
    for (int a = 0; a < 3; a++) {
        middle[a] = 0.5 * (double)(g->n[a] - 1);
        edge[a] = (double)(g->n[a] - 1) * g->spacing[a];
    }
    sdm_grid_world(g, middle, centre);
}

/* The spacing of args, or with --size alone the smallest uniform one with which the grid covers the
   box. */
static void choose_spacing(const cli_args *args, const double edge[3], sdm_grid *g)
{
    double need = 0;
    for (int a = 0; a < 3; a++)
        if (args->size[a] > 0)
            need = fmax(need, edge[a] / (double)(args->size[a] > 1 ? args->size[a] - 1 : 1));
    for (int a = 0; a < 3; a++)
        if (args->spacing[0] > 0)
            g->spacing[a] = args->spacing[a];
        else if (need > 0)
            g->spacing[a] = need;
}

sdm_status cli_model_grid(const cli_args *args, const sdm_grid *model, sdm_grid *out, bool *own,
                          sdm_error *err)
{
    const bool has_size = args->size[0] > 0, has_spacing = args->spacing[0] > 0,
               has_origin = isfinite(args->origin[0]), has_direction = isfinite(args->direction[0]);
    double centre[3], edge[3], middle[3], world[3];
    *own = false;
    if (args->like) return cli_like_grid(args, out, err);
    *out = *model;
    *own = !has_size && !has_spacing && !has_origin && !has_direction;
    if (*own) return SDM_OK;
    box_of(model, centre, edge);
    choose_spacing(args, edge, out);
    if (has_direction) memcpy(out->dir, args->direction, sizeof out->dir);
    for (int a = 0; a < 3; a++) {
        const double cells = edge[a] / out->spacing[a];
        if (!has_size && !(cells < 1048576))
            return sdm_fail(err, SDM_E_ARG,
                            "--spacing %g mm makes over 2^20 voxels along an edge of %g mm: need a "
                            "larger one",
                            out->spacing[a], edge[a]);
        out->n[a] = has_size ? args->size[a] : (int64_t)floor(cells + 1e-9) + 1;
        middle[a] = 0.5 * (double)(out->n[a] - 1);
    }
    // by default both have the same centre
    memset(out->origin, 0, sizeof out->origin);
    sdm_grid_world(out, middle, world);
    for (int a = 0; a < 3; a++)
        out->origin[a] = has_origin ? args->origin[a] : centre[a] - world[a];
    return sdm_grid_check(out, err);
}

sdm_status cli_explain_size(const cli_args *args, const sdm_grid *model, const sdm_grid *g,
                            sdm_status s, sdm_error *err)
{
    double centre[3], edge[3];
    int64_t n[3];
    if (s != SDM_E_RANGE || !(args->size[0] > 0) || args->spacing[0] > 0 ||
        isfinite(args->origin[0]) || isfinite(args->direction[0]))
        return s;
    box_of(model, centre, edge);
    // rounded down to five digits, the voxels still fit
    const double unit = pow(10, floor(log10(g->spacing[0])) - 4),
                 spacing = floor(g->spacing[0] / unit) * unit;
    for (int a = 0; a < 3; a++) {
        const int64_t most = (int64_t)floor(edge[a] / spacing + 1e-9) + 1;
        n[a] = g->n[a] < most ? g->n[a] : most;
    }
    return sdm_fail_in(err, s,
                       "--size alone makes cubes that cover the box of the model (--size "
                       "%lld,%lld,%lld --spacing %.5g stays in it)",
                       (long long)n[0], (long long)n[1], (long long)n[2], spacing);
}
