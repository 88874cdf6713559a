/* A field on a grid. */
#include <math.h>
#include <string.h>

#include "field_parts.h"
#include "sdm/internal/heap.h"

bool sdm_field_leaves(const sdm_field *f, const sdm_grid *g)
{
    // the box is convex: a grid lies in it if its corners do
    for (int c = 0; c < 8; c++) {
        double at[3], world[3];
        for (int a = 0; a < 3; a++) at[a] = c >> a & 1 ? (double)(g->n[a] - 1) : 0;
        sdm_grid_world(g, at, world);
        if (field_find(f, world).outside) return true;
    }
    return false;
}

/* The square of the distance to the box in row (j, k) of a grid: (beyond^2 + first) + second with
   the distance `beyond` along the row. These are the sums of field_square(), whichever axis of the
   map the row is parallel to. */
typedef struct row_square {
    float first, second;
} row_square;

static row_square square_of_row(const spline_grid *g, size_t j, size_t k)
{
    const spline_axis *axis = g->axis;
    float square[3] = {0};
    square[axis[1].axis] = axis[1].beyond[j] * axis[1].beyond[j];
    square[axis[2].axis] = axis[2].beyond[k] * axis[2].beyond[k];
    return axis[0].axis == 0   ? (row_square){square[1], square[2]}
           : axis[0].axis == 1 ? (row_square){square[0], square[2]}
                               : (row_square){square[0] + square[1], 0};
}

/* sdm_field_bound() for n voxels of a row. */
static void bound_part(row_square row, size_t n, const float *restrict beyond,
                       float *restrict values, float *restrict slopes)
{
    for (size_t i = 0; i < n; i++) {
        const float bound =
            field_bound(values[i], (beyond[i] * beyond[i] + row.first) + row.second);
        if (slopes)
            slopes[i] *= (values[i] > 0 ? values[i] : 0) / bound;
        else
            values[i] = bound;
    }
}

void sdm_field_bound(const sdm_field *f, const spline_grid *g, float *values, float *slopes)
{
    if (!g->axis[0].leaves && !g->axis[1].leaves && !g->axis[2].leaves) return;
    const size_t nx = g->axis[0].n, ny = g->axis[1].n, rows = ny * g->axis[2].n;
    // a row leaves the box at its ends
    size_t first = 0, last = nx;
    while (first < nx && g->axis[0].beyond[first] > 0) first++;
    while (last > first && g->axis[0].beyond[last - 1] > 0) last--;
#pragma omp parallel for schedule(static) num_threads(f->n_threads) if (f->n_threads > 1)
    for (size_t r = 0; r < rows; r++) {
        const size_t j = r % ny, k = r / ny;
        const bool whole = g->axis[1].beyond[j] > 0 || g->axis[2].beyond[k] > 0;
        const row_square row = square_of_row(g, j, k);
        const float *beyond = g->axis[0].beyond;
        float *to = values + r * nx, *by = slopes ? slopes + r * nx : NULL;
        bound_part(row, whole ? nx : first, beyond, to, by);
        if (!whole) bound_part(row, nx - last, beyond + last, to + last, by ? by + last : NULL);
    }
}

/* A grid whose axes are parallel to those of the map. */
static sdm_status parallel_map(const sdm_field *f, const sdm_grid *grid, float *values,
                               float *slopes, sdm_error *err)
{
    spline_grid g;
    const size_t n = sdm_grid_count(grid), n_maps = slopes ? f->info->n_params + 1 : 1;
    sdm_status s = sdm_spline_grid_create(&f->shape, &f->frame, grid, grid->n, 0, 1, &g, err);
    for (size_t i = 0; i < n_maps && !s; i++)
        s = sdm_spline_map(&f->shape, &g, f->splines + i * f->shape.count, f->maps + i * f->voxels,
                           f->n_threads, i ? slopes + (i - 1) * n : values, err);
    // the slopes of the bound need the distances at the box: they come first
    for (size_t i = 1; i < n_maps && !s; i++) sdm_field_bound(f, &g, values, slopes + (i - 1) * n);
    if (!s) sdm_field_bound(f, &g, values, NULL);
    sdm_spline_grid_dispose(&g);
    return s;
}

/* The place of voxel i of a row of the grid. */
static field_place voxel_place(const sdm_field *f, const sdm_grid *g, int64_t i, int64_t row)
{
    double world[3];
    sdm_grid_world(g, (const double[]){(double)i, (double)(row % g->n[1]), (double)(row / g->n[1])},
                   world);
    return field_find(f, world);
}

/* The derivatives by the parameters at a voxel, slopes[n_params][n]. */
static void turned_slopes(const sdm_field *f, const field_place *p, size_t n, float value,
                          float *slopes)
{
    float factor = 1;
    if (p->outside) factor = fmaxf(field_inside(f, p, 0), 0) / value;
    for (size_t q = 0; q < f->info->n_params; q++)
        slopes[q * n] = factor * field_inside(f, p, q + 1);
}

/* A turned grid: point by point. */
static void turned_map(const sdm_field *f, const sdm_grid *grid, float *values, float *slopes)
{
    const int64_t nx = grid->n[0], rows = grid->n[1] * grid->n[2];
#pragma omp parallel for schedule(static) num_threads(f->n_threads) if (f->n_threads > 1)
    for (int64_t r = 0; r < rows; r++)
        for (int64_t i = 0; i < nx; i++) {
            const field_place p = voxel_place(f, grid, i, r);
            values[r * nx + i] = field_value(f, &p);
            if (slopes)
                turned_slopes(f, &p, (size_t)(rows * nx), values[r * nx + i], slopes + r * nx + i);
        }
}

/* Replaces the values outside of the box by exact distances. */
static sdm_status exact_outside(const sdm_field *f, const sdm_grid *grid, float *values,
                                sdm_error *err)
{
    const int64_t nx = grid->n[0], rows = grid->n[1] * grid->n[2];
    float *exact = NULL;
    sdm_status s = sdm_alloc_unset((void **)&exact, sdm_grid_count(grid), sizeof *exact,
                                   "exact distances outside of the box", err);
    if (!s) s = sdm_exact_map(f->engine, grid, exact, err);
#pragma omp parallel for schedule(static) num_threads(f->n_threads) if (f->n_threads > 1)
    for (int64_t r = 0; r < (s ? 0 : rows); r++)
        for (int64_t i = 0; i < nx; i++)
            if (voxel_place(f, grid, i, r).outside) values[r * nx + i] = exact[r * nx + i];
    sdm_free(exact);
    return s;
}

sdm_status sdm_field_grid(const sdm_field *f, const sdm_grid *grid, float *values, float *slopes,
                          sdm_error *err)
{
    if (!f || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "field: a field, a grid and values are needed");
    sdm_status s = sdm_field_check(f, slopes, err);
    if (!s) s = sdm_grid_check(grid, err);
    if (s) return s;
    const sdm_exact_opts exact = {.n_threads = f->opts.n_threads};
    if (field_is_exact(f))
        return slopes ? sdm_exact_shape_jacobian(f->opts.exact_shape, f->params, &exact, grid,
                                                 values, slopes, NULL, err)
                      : sdm_exact_map(f->engine, grid, values, err);
    const bool leaves = sdm_field_leaves(f, grid);
    if (leaves && f->opts.outside == SDM_OUTSIDE_REFUSE)
        return sdm_field_refuse(f, "the grid leaves", err);
    if (leaves && f->opts.outside == SDM_OUTSIDE_EXACT && slopes)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "the grid leaves the box of the network: exact distances outside of it "
                        "have no derivatives by the parameters; use a grid in the box");
    if (sdm_spline_is_parallel(&f->frame, grid))
        s = parallel_map(f, grid, values, slopes, err);
    else
        turned_map(f, grid, values, slopes);
    return !s && leaves && f->opts.outside == SDM_OUTSIDE_EXACT
               ? exact_outside(f, grid, values, err)
               : s;
}
