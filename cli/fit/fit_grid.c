/* The grid of the exact maps of a fit. */
#include <math.h>
#include <string.h>

#include "fit_command.h"
#include "inputs/setup.h"
#include "sdm/internal/mesh_box.h"
#include "sdm/internal/shape_box.h"
#include "sdm/memory.h"

/* Limits of a grid that follows the thinnest part of the shape, because maps cost as much as there
 * are voxels: cells along its longest edge, and voxels in all. Other grids have at most 63 cells
 * along an edge. */
#define CELLS_MAX 127.0
#define COUNT_MAX 1e6

/* Enlarges the box by the shape at p. */
static sdm_status add_shape(const cli_fit *f, const double *p, sdm_box *b, sdm_error *err)
{
    sdm_mesh mesh = {0};
    const sdm_status s = sdm_instance_mesh(f->shape, p, &mesh, err);
    if (!s) sdm_box_add_mesh(b, &mesh);
    sdm_mesh_dispose(&mesh);
    return s;
}

/* *b holds the shape at the parameters start[], and with any single parameter moved to an end of
 * its range. Beyond the grid the fit can only estimate distances. */
static sdm_status find_box(const cli_fit *f, const double *start, sdm_box *b, sdm_error *err)
{
    double *p = NULL;
    sdm_status s = SDM_ALLOC(&p, f->n_params, "parameters", err);
    if (!s) memcpy(p, start, f->n_params * sizeof *p);
    if (!s) s = add_shape(f, p, b, err);
    for (size_t i = 0; i < f->n_params && !s; i++) {
        p[i] = f->params[i].min;
        s = add_shape(f, p, b, err);
        p[i] = f->params[i].max;
        if (!s) s = add_shape(f, p, b, err);
        p[i] = start[i];
    }
    sdm_free(p);
    return s;
}

/* *thick = thickness of the thinnest part of the shape at the start, mm; NaN: not known. */
static sdm_status start_thickness(const cli_fit *f, double *thick, sdm_error *err)
{
    double(*range)[2] = NULL;
    sdm_status s = SDM_ALLOC(&range, f->n_params, "parameters", err);
    for (size_t i = 0; i < f->n_params && !s; i++) range[i][0] = range[i][1] = f->start[i];
    if (!s) s = sdm_shape_thickness(f->shape, (const double(*)[2])range, 1, 1, thick, err);
    sdm_free(range);
    return s;
}

/* *g = the grid of the box b with cubic voxels. */
static sdm_status grid_of_spacing(const cli_fit *f, const sdm_box *b, double spacing, sdm_grid *g,
                                  sdm_error *err)
{
    cli_args finer = *f->args;
    for (int a = 0; a < 3; a++) finer.spacing[a] = spacing;
    return cli_grid_for_box(&finer, b->min, b->max, g, err);
}

/* Makes the grid g of the box b finer, if the thinnest part of the shape at the start needs it. */
static sdm_status refine_for_thin(cli_fit *f, const sdm_box *b, sdm_grid *g, sdm_error *err)
{
    double thick, volume = 1, longest = 0;
    const sdm_status s = start_thickness(f, &thick, err);
    if (s) return s;
    for (int a = 0; a < 3; a++) {
        const double edge = g->spacing[a] * (double)(g->n[a] - 1);
        volume *= edge, longest = fmax(longest, edge);
    }
    const double spacing =
        fmax(thick / SDM_GRID_THIN_VOXELS, fmax(longest / CELLS_MAX, cbrt(volume / COUNT_MAX)));
    if (!(thick > 0) || !(spacing < g->spacing[0])) return SDM_OK;
    f->thinnest = thick;
    return grid_of_spacing(f, b, spacing, g, err);
}

sdm_status cli_fit_make_grid(cli_fit *f, sdm_error *err)
{
    const cli_args *args = f->args;
    sdm_box box = SDM_BOX_EMPTY;
    if (f->source.model) return SDM_OK;
    if (f->model && !(args->spacing[0] > 0)) {
        f->source.grid = sdm_model_get_info(f->model)->grid;
        return SDM_OK;
    }
    sdm_status s = find_box(f, f->start, &box, err);
    if (!s) s = cli_grid_for_box(args, box.min, box.max, &f->source.grid, err);
    // distances of points are those from the surface itself
    const bool given = args->like || args->size[0] > 0 || args->spacing[0] > 0 || f->points;
    return s || given ? s : refine_for_thin(f, &box, &f->source.grid, err);
}

sdm_status cli_fit_finer_grid(const cli_fit *f, const double *params, double spacing, sdm_grid *out,
                              sdm_error *err)
{
    sdm_box box = SDM_BOX_EMPTY;
    const sdm_status s = find_box(f, params, &box, err);
    return s ? s : grid_of_spacing(f, &box, spacing, out, err);
}

double cli_fit_map_voxel(const cli_fit *f)
{
    return sdm_grid_coarsest(f->source.model ? &sdm_model_get_info(f->source.model)->grid
                                             : &f->source.grid);
}
