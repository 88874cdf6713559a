/* Splines on parallel grids: along x once for every row of coefficients, then in tiles along y and
   along z. */
#include "spline_grid.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include "spline_kernels.h"

/* Floats of a tile in a plane: four planes of it fit into the level 1 cache. */
enum { TILE = 2048, TILE_ROW = 1024 };

spline_frame sdm_spline_frame(const sdm_grid *map)
{
    spline_frame f;
    for (int a = 0; a < 3; a++) {
        f.origin[a] = map->origin[a];
        f.spacing[a] = map->spacing[a];
        for (int x = 0; x < 3; x++) f.to_index[3 * a + x] = map->dir[3 * x + a] / map->spacing[a];
    }
    memcpy(f.dir, map->dir, sizeof f.dir);
    return f;
}

/* The axis of the map that axis b of the grid is parallel to, -1: none. */
static int parallel_axis(const double dir[9], const sdm_grid *grid, int b)
{
    for (int a = 0; a < 3; a++) {
        double dot = 0;
        for (int x = 0; x < 3; x++) dot += dir[3 * x + a] * grid->dir[3 * x + b];
        if (!(fabs(dot) > 0.5)) continue;
        // the difference of the axes shows a small angle, its cosine does not
        double apart = 0;
        for (int x = 0; x < 3; x++)
            apart = fmax(apart, fabs(grid->dir[3 * x + b] - copysign(1, dot) * dir[3 * x + a]));
        return apart <= 1e-9 ? a : -1;
    }
    return -1;
}

bool sdm_spline_is_parallel(const spline_frame *f, const sdm_grid *grid)
{
    for (int b = 0; b < 3; b++)
        if (parallel_axis(f->dir, grid, b) < 0) return false;
    return true;
}

/* The places along axis b of the grid; arrays of n elements each are at `memory`. */
static void axis_fill(const spline_shape *s, const spline_frame *f, const sdm_grid *grid, int b,
                      double offset, double stride, spline_axis *x)
{
    x->low = INT32_MAX;
    x->high = 0;
    x->leaves = false;
    for (size_t i = 0; i < x->n; i++) {
        double index[3], world[3], at[3] = {0, 0, 0};
        at[b] = ((double)i + offset) * stride;
        sdm_grid_world(grid, at, world);
        sdm_spline_index(f, world, index);
        const spline_place p = sdm_spline_place(index[x->axis], s->n[x->axis]);
        x->cell[i] = p.cell;
        x->node[i] = p.node;
        sdm_spline_weights(p.t, x->weight[i]);
        x->beyond[i] = (float)(fabs(p.beyond) * f->spacing[x->axis]);
        x->leaves = x->leaves || p.beyond != 0;
        x->low = p.cell < x->low ? p.cell : x->low;
        x->high = p.cell + 4 > x->high ? p.cell + 4 : x->high;
    }
}

sdm_status sdm_spline_grid_create(const spline_shape *s, const spline_frame *f,
                                  const sdm_grid *grid, const int64_t n[3], double offset,
                                  double stride, spline_grid *out, sdm_error *err)
{
    enum { WORDS = 7 }; // cell, node, four weights, beyond
    memset(out, 0, sizeof *out);
    const size_t total = (size_t)n[0] + (size_t)n[1] + (size_t)n[2];
    const sdm_status status = SDM_ALLOC(&out->memory, WORDS * total, "places of voxels", err);
    int32_t *at = out->memory;
    for (int b = 0; b < 3 && !status; b++) {
        spline_axis *x = &out->axis[b];
        x->n = (size_t)n[b];
        x->axis = parallel_axis(f->dir, grid, b);
        x->weight = (float(*)[4])at;
        x->cell = at + 4 * x->n;
        x->node = x->cell + x->n;
        x->beyond = (float *)(x->node + x->n);
        at += WORDS * x->n;
        axis_fill(s, f, grid, b, offset, stride, x);
    }
    return status;
}

void sdm_spline_grid_dispose(spline_grid *g)
{
    sdm_free(g->memory);
    memset(g, 0, sizeof *g);
}

/* Interpolates pieces begin .. end - 1 of a row along x. */
static void pieces_expand(const spline_axis *x, size_t begin, size_t end, const float *row,
                          const spline_table *kernels, float *to)
{
    const size_t first = begin * SPLINE_PIECE,
                 last = end * SPLINE_PIECE < x->n ? end * SPLINE_PIECE : x->n;
    kernels->expand(last - first, x->cell + first, (const float(*)[4])x->weight + first, row, to);
}

/* Interpolates the wanted pieces of the row of coefficients (j, k). gathered[padded]: scratch
   memory. */
static void row_expand(const spline_shape *s, const spline_grid *g, const float *coefficient,
                       const spline_part *part, size_t j, size_t k, const spline_table *kernels,
                       float *gathered, float *to)
{
    const spline_axis *x = &g->axis[0];
    const size_t step = s->step[x->axis], n = part->n[0];
    const uint8_t *wanted = part->wanted;
    if (wanted) wanted += (k * part->n[1] + j) * n;
    if (wanted && !memchr(wanted, 1, n)) return;
    const float *row = coefficient + (part->first[1] + j) * s->step[g->axis[1].axis] +
                       (part->first[2] + k) * s->step[g->axis[2].axis];
    if (step != 1) {
        for (int32_t i = x->low; i < x->high; i++) gathered[i] = row[(size_t)i * step];
        row = gathered;
    }
    for (size_t p = 0, end; p < n; p = end + 1) {
        for (end = p; end < n && (!wanted || wanted[end]); end++) continue;
        if (end > p)
            pieces_expand(x, part->first[0] + p, part->first[0] + end, row, kernels,
                          to + p * SPLINE_PIECE);
    }
}

sdm_status sdm_spline_rows(const spline_shape *s, const spline_grid *g, const float *coefficient,
                           const spline_part *part, int n_threads, float *rows, sdm_error *err)
{
    const spline_table *kernels = sdm_spline_kernels();
    float *gathered = NULL;
    const size_t length = s->padded[g->axis[0].axis], line = part->n[0] * SPLINE_PIECE;
    const sdm_status status =
        SDM_ALLOC(&gathered, length * (size_t)n_threads, "row of a spline", err);
    if (status) return status;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t k = 0; k < part->n[2]; k++)
        for (size_t j = 0; j < part->n[1]; j++)
            row_expand(s, g, coefficient, part, j, k, kernels,
                       gathered + (size_t)sdm_thread() * length,
                       rows + (k * part->n[1] + j) * line);
    sdm_free(gathered);
    return SDM_OK;
}

/* A tile: the voxels of some rows and part of their length, in all planes. */
typedef struct tile {
    size_t i, j, width, height;
} tile;

/* planes[coefficients in use along z][height][width] = the tile, interpolated along y. rows: those
   of `part`, the coefficients in use. */
static void tile_planes(const spline_grid *g, const spline_part *part, const float *rows,
                        const tile *t, const spline_table *kernels, float *planes)
{
    const spline_axis *y = &g->axis[1];
    const size_t line = part->n[0] * SPLINE_PIECE;
    for (size_t k = 0; k < part->n[2]; k++)
        for (size_t j = t->j; j < t->j + t->height; j++, planes += t->width) {
            const float *first =
                rows + (k * part->n[1] + (size_t)(y->cell[j] - y->low)) * line + t->i;
            const float *const four[4] = {first, first + line, first + 2 * line, first + 3 * line};
            kernels->combine(t->width, four, y->weight[j], planes);
        }
}

/* Writes the tile of plane k. */
static void tile_write(const spline_grid *g, const tile *t, const float *planes, size_t k,
                       const spline_table *kernels, float *values)
{
    const spline_axis *z = &g->axis[2];
    const size_t nx = g->axis[0].n, ny = g->axis[1].n, size = t->width * t->height;
    const float *first = planes + (size_t)(z->cell[k] - z->low) * size;
    float *to = values + (k * ny + t->j) * nx + t->i;
    const size_t pieces = t->width == nx ? 1 : t->height, length = size / pieces;
    for (size_t p = 0; p < pieces; p++, first += length, to += nx) {
        const float *const four[4] = {first, first + size, first + 2 * size, first + 3 * size};
        kernels->combine(length, four, z->weight[k], to);
    }
}

/* Replaces the values at nodes by those of the map. */
static void write_nodes(const spline_shape *s, const spline_grid *g, const tile *t, size_t k,
                        const float *map, float *values)
{
    const size_t nx = g->axis[0].n, ny = g->axis[1].n;
    if (g->axis[2].node[k] < 0) return;
    for (size_t j = t->j; j < t->j + t->height; j++) {
        if (g->axis[1].node[j] < 0) continue;
        for (size_t i = t->i; i < t->i + t->width; i++) {
            const int64_t at =
                sdm_spline_node(s, g, (const int64_t[]){(int64_t)i, (int64_t)j, (int64_t)k});
            if (at >= 0) values[(k * ny + j) * nx + i] = map[at];
        }
    }
}

sdm_status sdm_spline_map(const spline_shape *s, const spline_grid *g, const float *coefficient,
                          const float *map, int n_threads, float *values, sdm_error *err)
{
    const size_t nx = g->axis[0].n, ny = g->axis[1].n, nz = g->axis[2].n;
    const size_t width = nx < TILE_ROW ? nx : TILE_ROW,
                 height = TILE / width < ny ? TILE / width : ny;
    const size_t across = (nx + width - 1) / width, tiles = across * ((ny + height - 1) / height);
    const size_t planes = (size_t)(g->axis[2].high - g->axis[2].low) * width * height;
    const spline_table *kernels = sdm_spline_kernels();
    const spline_axis *y = &g->axis[1], *z = &g->axis[2];
    const spline_part part = {.first = {0, (size_t)y->low, (size_t)z->low},
                              .n = {(nx + SPLINE_PIECE - 1) / SPLINE_PIECE,
                                    (size_t)(y->high - y->low), (size_t)(z->high - z->low)}};
    float *rows = NULL, *memory = NULL;
    size_t count;
    sdm_status status = sdm_mul(part.n[0] * SPLINE_PIECE * part.n[1], part.n[2], &count, err);
    if (!status)
        status = sdm_alloc_unset((void **)&rows, count, sizeof *rows, "rows of a spline", err);
    if (!status) status = sdm_spline_rows(s, g, coefficient, &part, n_threads, rows, err);
    if (!status)
        status = sdm_alloc_unset((void **)&memory, planes * (size_t)n_threads, sizeof *memory,
                                 "planes of a spline", err);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (size_t n = 0; n < (status ? 0 : tiles); n++) {
        const size_t i = n % across * width, j = n / across * height;
        const tile t = {i, j, nx - i < width ? nx - i : width, ny - j < height ? ny - j : height};
        float *own = memory + (size_t)sdm_thread() * planes;
        tile_planes(g, &part, rows, &t, kernels, own);
        for (size_t k = 0; k < nz; k++) {
            tile_write(g, &t, own, k, kernels, values);
            if (map) write_nodes(s, g, &t, k, map, values);
        }
    }
    sdm_free(memory);
    sdm_free(rows);
    return status;
}
