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

/* Replaces the spline's value at a voxel of the map by the map's, and then a value outside of the
   box by the bound; slopes[n_params][n], the derivatives by the parameters (NULL: none), alike. */
static void turned_apart(const sdm_field *f, const field_place *p, size_t n, float *value,
                         float *slopes)
{
    const size_t n_slopes = slopes ? f->info->n_params : 0;
    if (p->node >= 0) {
        *value = field_inside(f, p, 0);
        for (size_t q = 0; q < n_slopes; q++) slopes[q * n] = field_inside(f, p, q + 1);
    }
    if (!p->outside) return;
    const float d = *value;
    *value = field_bound(d, field_square(p->beyond));
    for (size_t q = 0; q < n_slopes; q++) slopes[q * n] *= fmaxf(d, 0) / *value;
}

/* Row 0 of a turned grid. */
static spline_line turned_line(const sdm_field *f, const sdm_grid *grid)
{
    spline_line line = {.frame = f->frame};
    for (int a = 0; a < 3; a++) {
        line.origin[a] = grid->origin[a];
        line.along[a] = grid->dir[3 * a] * grid->spacing[0];
        line.n[a] = f->shape.n[a];
        line.step[a] = f->shape.step[a];
    }
    return line;
}

/* Moves to row (j, k): the sums of sdm_grid_world(). */
static void move_line(const sdm_grid *grid, int64_t j, int64_t k, spline_line *line)
{
    for (int a = 0; a < 3; a++) {
        line->across[a] = grid->dir[3 * a + 1] * grid->spacing[1] * (double)j;
        line->up[a] = grid->dir[3 * a + 2] * grid->spacing[2] * (double)k;
    }
}

/* Row r of a turned grid; values and slopes are those of the whole grid. */
static void turned_row(const sdm_field *f, const sdm_grid *grid, const spline_line *line, int64_t r,
                       float *values, float *slopes)
{
    const size_t nx = (size_t)grid->n[0], all = sdm_grid_count(grid), begin = (size_t)r * nx;
    const size_t n_maps = slopes ? f->info->n_params + 1 : 1;
    spline_run run;
    for (size_t first = 0; first < nx; first += SPLINE_RUN) {
        const size_t n = nx - first < SPLINE_RUN ? nx - first : SPLINE_RUN;
        float *to = values + begin + first, *by = slopes ? slopes + begin + first : NULL;
        f->kernels->places(line, first, n, &run);
        for (size_t q = 0; q < n_maps; q++)
            f->kernels->run(f->splines + q * f->shape.count, f->shape.step, n, &run,
                            q ? by + (q - 1) * all : to);
        for (size_t i = 0; i < n; i++) {
            if (!run.apart[i]) continue;
            const field_place p = voxel_place(f, grid, (int64_t)(first + i), r);
            turned_apart(f, &p, all, to + i, by ? by + i : NULL);
        }
    }
}

/* A turned grid: row by row. */
static void turned_map(const sdm_field *f, const sdm_grid *grid, float *values, float *slopes)
{
    const int64_t rows = grid->n[1] * grid->n[2];
    const spline_line first = turned_line(f, grid);
#pragma omp parallel for schedule(static) num_threads(f->n_threads) if (f->n_threads > 1)
    for (int64_t r = 0; r < rows; r++) {
        spline_line line = first;
        move_line(grid, r % grid->n[1], r / grid->n[1], &line);
        turned_row(f, grid, &line, r, values, slopes);
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
    if (!s) s = sdm_exact_map(f->surface.engine, grid, exact, err);
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
    const shape_surface *exact = &f->surface;
    if (field_is_exact(f))
        return slopes
                   ? sdm_exact_map_derivative(exact->engine, grid, exact->velocity, exact->n_params,
                                              &(sdm_exact_layers){.values = values}, slopes, err)
                   : sdm_exact_map(f->surface.engine, grid, values, err);
    const bool leaves = sdm_field_leaves(f, grid);
    if (leaves && f->opts.outside == SDM_OUTSIDE_REFUSE)
        return sdm_field_refuse(f, "the grid leaves", err);
    if (leaves && f->opts.outside == SDM_OUTSIDE_EXACT && slopes)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "the grid leaves the box of the network: derivatives of a map by the "
                        "parameters are known in the box alone; use a grid in the box, or "
                        "points");
    if (sdm_spline_is_parallel(&f->frame, grid))
        s = parallel_map(f, grid, values, slopes, err);
    else
        turned_map(f, grid, values, slopes);
    return !s && leaves && f->opts.outside == SDM_OUTSIDE_EXACT
               ? exact_outside(f, grid, values, err)
               : s;
}
