/* Method "cells": a uniform grid of cells, each with a list of triangles. Around every voxel the
 * cells are searched in growing cubic shells (cells as in Huang, Li, Crawfis, Li 2001). The
 * distances are exact. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "method.h"
#include "sdm/memory.h"

/* Saturation value of cells.gap. */
#define GAP_MAX UINT8_MAX

typedef struct cells {
    sdm_run *run;
    sdm_frame *frames; /* [n_tri] */
    double lo[3], hi[3], edge;
    int64_t n[3];
    size_t count;
    /* [count + 1] triangles of cell i: list[first[i] .. first[i + 1] - 1] */
    uint32_t *first;
    uint32_t *list; /* triangles of each cell */
    /* [n_threads][n_tri] number (from 1) of the last voxel for which the thread tested this
     * triangle */
    uint64_t *seen;
    /* [count] Chebyshev distance (largest index difference) to the nearest cell with triangles, at
     * most GAP_MAX; 0: the cell has triangles */
    uint8_t *gap;
} cells;

static size_t cell_number(const cells *c, const int64_t i[3])
{
    return (size_t)((i[2] * c->n[1] + i[1]) * c->n[0] + i[0]);
}

static int64_t cell_index(const cells *c, int axis, double x)
{
    const double i = floor((x - c->lo[axis]) / c->edge), last = (double)(c->n[axis] - 1);
    return (int64_t)(i > 0 ? i < last ? i : last : 0);
}

/* Chooses the size of the cells: about twice that of the triangles, but such that there are at most
 * 8 n_tri + 512 cells. */
static void cells_choose_size(cells *c)
{
    const sdm_mesh *m = c->run->surface;
    double longest = 0, most = 8 * (double)m->n_tri + 512, count;
    for (int a = 0; a < 3; a++) {
        c->lo[a] = INFINITY;
        c->hi[a] = -INFINITY;
    }
    for (size_t i = 0; i < 3 * m->n_tri; i++) {
        for (int a = 0; a < 3; a++) {
            const double x = m->vert[3 * (size_t)m->tri[i] + (size_t)a];
            c->lo[a] = sdm_lesser(c->lo[a], x);
            c->hi[a] = sdm_greater(c->hi[a], x);
        }
    }
    for (int a = 0; a < 3; a++) longest = sdm_greater(longest, c->hi[a] - c->lo[a]);
    c->edge = 2 * sqrt(c->run->report.exact.audit.area / (double)m->n_tri);
    if (!(c->edge > longest / 1024)) c->edge = longest > 0 ? longest / 1024 : 1;
    // enlarge the cells until there are few enough
    for (;; c->edge *= 1.25) {
        count = 1;
        for (int a = 0; a < 3; a++) count *= floor((c->hi[a] - c->lo[a]) / c->edge) + 1;
        if (count <= most) break;
    }
    for (int a = 0; a < 3; a++) c->n[a] = (int64_t)floor((c->hi[a] - c->lo[a]) / c->edge) + 1;
    c->count = (size_t)(c->n[0] * c->n[1] * c->n[2]);
}

/* Does the plane of the triangle meet the cell, up to a margin for rounding? */
static bool cell_meets_plane(const cells *c, const sdm_frame *f, const int64_t i[3])
{
    double along = 0, reach = 0;
    for (int a = 0; a < 3; a++) {
        along += f->n[a] * (c->lo[a] + ((double)i[a] + 0.5) * c->edge - f->a[a]);
        reach += fabs(f->n[a]) * 0.5 * c->edge;
    }
    const double size = fabs(c->lo[0]) + fabs(c->lo[1]) + fabs(c->lo[2]) + fabs(c->hi[0]) +
                        fabs(c->hi[1]) + fabs(c->hi[2]);
    return fabs(along) <= reach + 1e-14 * size;
}

/* Adds triangle t to the cells that it may meet. While c->list is NULL triangles are only
 * counted. */
static void cells_add_triangle(cells *c, size_t t)
{
    int64_t from[3], to[3], i[3];
    for (int a = 0; a < 3; a++) {
        double lo = INFINITY, hi = -INFINITY;
        for (size_t k = 0; k < 3; k++) {
            const double x =
                c->run->surface->vert[3 * (size_t)c->run->surface->tri[3 * t + k] + (size_t)a];
            lo = sdm_lesser(lo, x);
            hi = sdm_greater(hi, x);
        }
        from[a] = cell_index(c, a, lo);
        to[a] = cell_index(c, a, hi);
    }
    for (i[2] = from[2]; i[2] <= to[2]; i[2]++) {
        for (i[1] = from[1]; i[1] <= to[1]; i[1]++) {
            for (i[0] = from[0]; i[0] <= to[0]; i[0]++) {
                if (!cell_meets_plane(c, &c->frames[t], i)) continue;
                const uint32_t at = c->first[cell_number(c, i)]++;
                if (c->list) c->list[at] = (uint32_t)t;
            }
        }
    }
}

static sdm_status cells_fill_lists(cells *c, sdm_error *err)
{
    sdm_status s = sdm_run_reserve(c->run, c->count + 1, sizeof *c->first, err);
    if (!s) s = SDM_ALLOC(&c->first, c->count + 1, "cells", err);
    // count the triangles of each cell
    for (size_t t = 0; t < c->run->surface->n_tri && !s; t++) cells_add_triangle(c, t);
    size_t sum = 0;
    for (size_t i = 0; i <= c->count && !s; i++) {
        const uint32_t n = c->first[i];
        c->first[i] = (uint32_t)sum;
        sum += n;
        if (sum > UINT32_MAX)
            s = sdm_fail(err, SDM_E_NOMEM, "more than %u triangles in cells", UINT32_MAX);
    }
    // fill the lists
    if (!s) s = sdm_run_reserve(c->run, sum, sizeof *c->list, err);
    if (!s) s = SDM_ALLOC(&c->list, sum, "triangles of cells", err);
    if (s) return s;
    for (size_t t = 0; t < c->run->surface->n_tri; t++) cells_add_triangle(c, t);
    // the fill has advanced every start to the start of the next cell: shift them back
    memmove(c->first + 1, c->first, c->count * sizeof *c->first);
    c->first[0] = 0;
    return SDM_OK;
}

/* New gap of cell i: min(gap of cell i, gap of each neighbour that the sweep has already visited +
 * 1). */
static uint8_t gap_from_neighbours(const cells *c, const int64_t i[3], int direction)
{
    uint8_t least = c->gap[cell_number(c, i)];
    for (int k = 0; k < 13; k++) {
        // the 13 neighbours that come before in memory order; direction = -1 mirrors them
        const int64_t d[3] = {k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1};
        int64_t o[3];
        bool within = true;
        for (int a = 0; a < 3; a++) {
            o[a] = i[a] + direction * d[a];
            within = within && o[a] >= 0 && o[a] < c->n[a];
        }
        if (within && c->gap[cell_number(c, o)] < least)
            least = (uint8_t)(c->gap[cell_number(c, o)] + 1);
    }
    return least;
}

/* Computes cells.gap by one sweep in memory order and one in reverse order, which give exact
 * Chebyshev distances (Borgefors 1986). */
static sdm_status cells_measure_gaps(cells *c, sdm_error *err)
{
    sdm_status s = sdm_run_reserve(c->run, c->count, sizeof *c->gap, err);
    if (!s) s = SDM_ALLOC(&c->gap, c->count, "empty cells", err);
    if (s) return s;
    for (size_t i = 0; i < c->count; i++) c->gap[i] = c->first[i] < c->first[i + 1] ? 0 : GAP_MAX;
    for (int direction = 1; direction >= -1; direction -= 2) {
        for (size_t k = 0; k < c->count; k++) {
            const int64_t at = (int64_t)(direction > 0 ? k : c->count - 1 - k);
            const int64_t i[3] = {at % c->n[0], at / c->n[0] % c->n[1], at / (c->n[0] * c->n[1])};
            c->gap[at] = gap_from_neighbours(c, i, direction);
        }
    }
    return SDM_OK;
}

/* Squared distance from x to the slab of cells with index i along an axis. */
static double slab_distance2(const cells *c, int axis, int64_t i, double x)
{
    const double y = x - c->lo[axis], lo = (double)i * c->edge;
    const double d = sdm_greater(0, sdm_greater(lo - y, y - (lo + c->edge)));
    return d * d;
}

/* Lower bound on the squared distance from x to all cells of the shells >= r around the cell
 * `middle`; INFINITY when these shells lie outside of the cell grid. */
static double shell_distance2(const cells *c, const int64_t middle[3], const double x[3], int64_t r)
{
    double out2[3], least = INFINITY;
    for (int a = 0; a < 3; a++) {
        const double d = sdm_greater(
            0, sdm_greater(c->lo[a] - x[a], x[a] - (c->lo[a] + (double)c->n[a] * c->edge)));
        out2[a] = d * d;
    }
    for (int a = 0; a < 3; a++) {
        const double rest = out2[(a + 1) % 3] + out2[(a + 2) % 3];
        if (middle[a] + r < c->n[a])
            least = sdm_lesser(least, slab_distance2(c, a, middle[a] + r, x[a]) + rest);
        if (middle[a] - r >= 0)
            least = sdm_lesser(least, slab_distance2(c, a, middle[a] - r, x[a]) + rest);
    }
    return least;
}

/* State of the search for the nearest triangle of one voxel. */
typedef struct search {
    double x[3], d2;   /* voxel centre; squared distance to the nearest triangle so far */
    int64_t middle[3]; /* cell of x */
    uint32_t triangle;
    uint64_t voxel;
    uint64_t *seen; /* row of this thread in cells.seen */
} search;

static void search_cell(const cells *c, size_t cell, search *s)
{
    for (uint32_t i = c->first[cell]; i < c->first[cell + 1]; i++) {
        const uint32_t t = c->list[i];
        if (s->seen[t] == s->voxel) continue;
        s->seen[t] = s->voxel;
        const double d2 = sdm_frame_distance2(&c->frames[t], s->x);
        if (!(d2 < s->d2)) continue;
        s->d2 = d2;
        s->triangle = t;
    }
}

static void search_shell(const cells *c, int64_t r, search *s)
{
    // the shell within the cell grid
    const int64_t *middle = s->middle;
    int64_t from[3], to[3], i[3];
    for (int a = 0; a < 3; a++) {
        from[a] = middle[a] - r > 0 ? middle[a] - r : 0;
        to[a] = middle[a] + r < c->n[a] ? middle[a] + r : c->n[a] - 1;
    }
    for (i[2] = from[2]; i[2] <= to[2]; i[2]++) {
        const double z2 = slab_distance2(c, 2, i[2], s->x[2]);
        for (i[1] = from[1]; i[1] <= to[1] && z2 < s->d2; i[1]++) {
            const double yz2 = z2 + slab_distance2(c, 1, i[1], s->x[1]);
            if (!(yz2 < s->d2)) continue;
            // a row of cells on a face of the shell belongs to the shell entirely; of other rows
            // only the two end cells do
            const bool face = i[2] == middle[2] - r || i[2] == middle[2] + r ||
                              i[1] == middle[1] - r || i[1] == middle[1] + r;
            for (i[0] = face ? from[0] : middle[0] - r; i[0] <= to[0];) {
                int64_t step = face || r == 0 ? 1 : 2 * r;
                if (i[0] >= 0) {
                    const size_t cell = cell_number(c, i);
                    if (c->gap[cell] == 0) {
                        if (yz2 + slab_distance2(c, 0, i[0], s->x[0]) < s->d2)
                            search_cell(c, cell, s);
                    } else if (c->gap[cell] > step) {
                        step = c->gap[cell];
                    }
                }
                i[0] += step;
            }
        }
    }
}

static void cells_map_row(void *job, int64_t row, int thread)
{
    const cells *c = job;
    const sdm_grid *g = c->run->grid;
    float *values = c->run->values + row * g->n[0];
    search s = {.d2 = INFINITY, .seen = c->seen + (size_t)thread * c->run->surface->n_tri};
    for (int64_t i = 0; i < g->n[0]; i++) {
        const double index[3] = {(double)i, (double)(row % g->n[1]), (double)(row / g->n[1])};
        sdm_grid_world(g, index, s.x);
        s.voxel = (uint64_t)(row * g->n[0] + i + 1);
        for (int a = 0; a < 3; a++) s.middle[a] = cell_index(c, a, s.x[a]);
        // the nearest triangle of the previous voxel gives a close upper bound
        if (i > 0) s.d2 = sdm_frame_distance2(&c->frames[s.triangle], s.x);
        for (int64_t r = c->gap[cell_number(c, s.middle)];
             shell_distance2(c, s.middle, s.x, r) < s.d2; r++)
            search_shell(c, r, &s);
        values[i] = (float)sqrt(s.d2);
    }
}

static sdm_status cells_map(const sdm_mesh *mesh, const sdm_grid *grid, const sdm_method_opts *opts,
                            float *values, sdm_method_report *report, sdm_error *err)
{
    sdm_run run;
    cells c = {.run = &run};
    sdm_status s = sdm_run_begin(&run, mesh, grid, opts, values, err);
    if (!s) s = sdm_run_frames(&run, &c.frames, err);
    if (!s) cells_choose_size(&c);
    if (!s) s = cells_fill_lists(&c, err);
    if (!s) s = cells_measure_gaps(&c, err);
    const size_t seen = s ? 0 : (size_t)run.n_threads * run.surface->n_tri;
    if (!s) s = sdm_run_reserve(&run, seen, sizeof *c.seen, err);
    if (!s) s = SDM_ALLOC(&c.seen, seen, "triangles seen", err);
    if (!s) sdm_run_prepared(&run);
    if (!s) s = sdm_run_parts(&run, grid->n[1] * grid->n[2], cells_map_row, &c, 0, 1, err);
    if (!s) s = sdm_run_sign(&run, err);
    if (!s)
        snprintf(run.report.note, sizeof run.report.note,
                 "%lld x %lld x %lld cells of %.3g mm, %.1f triangles in each", (long long)c.n[0],
                 (long long)c.n[1], (long long)c.n[2], c.edge,
                 (double)c.first[c.count] / (double)c.count);
    sdm_free(c.frames);
    sdm_free(c.first);
    sdm_free(c.list);
    sdm_free(c.seen);
    sdm_free(c.gap);
    return sdm_run_end(&run, report, s);
}

const sdm_method sdm_method_cells = {
    "cells", "uniform cells with lists of triangles, searched in growing shells",
    "Huang, Li, Crawfis, Li 2001", true, cells_map};
