/* Method "octree": adaptively sampled distances (Frisken, Perry, Rockwood, Jones 2000) on the grid
 * of voxel centres. A cell is a box of voxels with exact distances at its 8 corners. It is
 * subdivided until trilinear interpolation from the corners is proved to be within max_error_mm of
 * the distance everywhere in the cell, or until no voxel lies between the corners.
 *
 * Proof. The list of a cell contains every triangle that is nearest to some point of the cell. Let
 * d_k be the distances at the corners c_k, I(x) their trilinear interpolation, c the cell centre
 * and N the triangle nearest to c. The distance d(x, T) to one triangle is a convex function of x,
 * and trilinear interpolation is a weighted mean over the corners. Upper bound:
 *     d(x) <= d(x, N) <= interpolation of d(c_k, N) <= I(x) + max_k (d(c_k, N) - d_k).
 * Lower bound: d(x, T) >= L_T(x), the linear function that touches d(., T) at c, hence
 *     d(x) >= I(x) + min_T min_k (L_T(c_k) - d_k).
 * A triangle with L_T(c_k) > d(c_k, N) at every corner k is nearest nowhere in the cell and is
 * removed from the list. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "method.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

/* Edge length of a top cell in voxels, and an upper bound on the subdivision depth. */
enum { TOP = 32, DEPTH = 6 };
enum { SIDE = TOP + 1, LATTICE = SIDE * SIDE * SIDE };
/* Up to this many triangles, testing all of them is faster than a nearest-point query of the
 * engine. */
enum { SHORT_LIST = 32 };
enum { UNKNOWN, INTERPOLATED, EXACT };

/* Linear lower bound L_T of the distance to a triangle: d + gradient . (x - c) around the cell
 * centre c. */
typedef struct tangent {
    uint32_t triangle;
    double d, gradient[3];
} tangent;

/* Scratch memory of one thread. */
typedef struct scratch {
    /* [LATTICE] unsigned distance at the voxels of the top cell, mm */
    double *value;
    uint8_t *state;   /* [LATTICE] UNKNOWN, INTERPOLATED or EXACT */
    tangent *tangent; /* [n_tri] */
    /* [(DEPTH + 1) * n_tri] stack of triangle lists: from the top cell to the current cell */
    uint32_t *list;
    size_t n_exact;
} scratch;

typedef struct octree {
    sdm_run *run;
    const sdm_frame *frames;
    double (*ball)[4]; /* [n_tri] centre and radius of a bounding sphere of each triangle */
    double max_error;
    int64_t n_top[3];
    scratch *scratch; /* [n_threads] */
} octree;

/* A cell: the voxels lo .. hi, counted from the first voxel `origin` of its top cell. */
typedef struct cell {
    int64_t lo[3], hi[3];
} cell;

static size_t lattice_number(int64_t i, int64_t j, int64_t k)
{
    return (size_t)((k * SIDE + j) * SIDE + i);
}

static void voxel_world(const octree *o, const int64_t origin[3], const double at[3], double x[3])
{
    const double index[3] = {(double)origin[0] + at[0], (double)origin[1] + at[1],
                             (double)origin[2] + at[2]};
    sdm_grid_world(o->run->grid, index, x);
}

/* Distance at voxel i (counted from `origin`) of a cell with the triangles list[n]; computed once
 * per voxel. */
static double cell_exact_distance(const octree *o, scratch *w, const int64_t origin[3],
                                  const int64_t i[3], const uint32_t *list, size_t n)
{
    const size_t at = lattice_number(i[0], i[1], i[2]);
    if (w->state[at] == EXACT) return w->value[at];
    double x[3], least = INFINITY;
    voxel_world(o, origin, (const double[3]){(double)i[0], (double)i[1], (double)i[2]}, x);
    for (size_t t = 0; t < n && n <= SHORT_LIST; t++)
        least = sdm_lesser(least, sdm_frame_distance2(&o->frames[list[t]], x));
    w->value[at] = n <= SHORT_LIST ? sqrt(least) : sdm_exact_distance(o->run->engine, x);
    w->state[at] = EXACT;
    w->n_exact++;
    return w->value[at];
}

/* Writes to out[n] the tangents at c of those triangles of list[n] that can be nearest to a point
 * within `radius` of c; the triangle nearest to c comes first. Returns the number of tangents. */
static size_t cell_tangents(const octree *o, tangent *out, const uint32_t *list, size_t n,
                            const double c[3], double radius)
{
    double least = INFINITY;
    size_t nearest = 0, kept = 0;
    for (size_t i = 0; i < n; i++) {
        tangent *t = &out[i];
        double q[3];
        int feature;
        t->triangle = list[i];
        t->d = sqrt(sdm_frame_closest(&o->frames[list[i]], c, q, &feature));
        for (int a = 0; a < 3; a++) t->gradient[a] = t->d > 0 ? (c[a] - q[a]) / t->d : 0;
        if (t->d < least) {
            least = t->d;
            nearest = i;
        }
    }
    const tangent first = out[nearest];
    out[nearest] = out[0];
    out[0] = first;
    for (size_t i = 0; i < n; i++)
        if (out[i].d <= least + 2 * radius) out[kept++] = out[i];
    return kept;
}

/* Tests the bounds of the proof at the top of this file: true if the interpolation is accurate
 * enough in the whole cell. corner[k] = d_k, arm[k] = c_k - c. Also writes the triangle list
 * out[*n] for the cell's children. */
static bool cell_prove(const octree *o, const double c[3], const double arm[8][3],
                       const double corner[8], const tangent *t, size_t n_tangents, uint32_t *out,
                       size_t *n)
{
    // upper bound of the proof: d(c_k, N) - d_k
    const sdm_frame *nearest = &o->frames[t[0].triangle];
    double above = -INFINITY, below = INFINITY, top[8];
    for (int k = 0; k < 8; k++) {
        double x[3];
        v3_along(c, 1, arm[k], x);
        top[k] = sqrt(sdm_frame_distance2(nearest, x));
        above = sdm_greater(above, top[k] - corner[k]);
    }
    // lower bound, and the triangles that remain
    *n = 0;
    for (size_t i = 0; i < n_tangents; i++) {
        double room = INFINITY, error = INFINITY;
        for (int k = 0; k < 8; k++) {
            const double plane = t[i].d + v3_dot(t[i].gradient, arm[k]);
            room = sdm_lesser(room, plane - top[k]);
            error = sdm_lesser(error, plane - corner[k]);
        }
        if (room > 0 && i > 0) continue;
        out[(*n)++] = t[i].triangle;
        below = sdm_lesser(below, error);
    }
    return above <= o->max_error && -below <= o->max_error;
}

static void cell_interpolate(scratch *w, const cell *c, const double corner[8])
{
    for (int64_t k = c->lo[2]; k <= c->hi[2]; k++) {
        for (int64_t j = c->lo[1]; j <= c->hi[1]; j++) {
            for (int64_t i = c->lo[0]; i <= c->hi[0]; i++) {
                const size_t at = lattice_number(i, j, k);
                if (w->state[at] != UNKNOWN) continue;
                const int64_t index[3] = {i, j, k};
                double part[3], sum = 0;
                for (int a = 0; a < 3; a++)
                    part[a] = c->hi[a] > c->lo[a]
                                  ? (double)(index[a] - c->lo[a]) / (double)(c->hi[a] - c->lo[a])
                                  : 0;
                for (int q = 0; q < 8; q++) {
                    double weight = 1;
                    for (int a = 0; a < 3; a++) weight *= q >> a & 1 ? part[a] : 1 - part[a];
                    sum += weight * corner[q];
                }
                w->value[at] = sum;
                w->state[at] = INTERPOLATED;
            }
        }
    }
}

static void cell_refine(const octree *o, scratch *w, const int64_t origin[3], const cell *c,
                        const uint32_t *list, size_t n)
{
    double middle[3], x[3], arm[8][3], corner[8], radius = 0;
    bool between = false;
    for (int a = 0; a < 3; a++) {
        middle[a] = 0.5 * (double)(c->lo[a] + c->hi[a]);
        between = between || c->hi[a] - c->lo[a] > 1;
    }
    voxel_world(o, origin, middle, x);
    for (int k = 0; k < 8; k++) {
        int64_t i[3];
        for (int a = 0; a < 3; a++) i[a] = k >> a & 1 ? c->hi[a] : c->lo[a];
        corner[k] = cell_exact_distance(o, w, origin, i, list, n);
        voxel_world(o, origin, (const double[3]){(double)i[0], (double)i[1], (double)i[2]}, arm[k]);
        v3_sub(arm[k], x, arm[k]);
        radius = sdm_greater(radius, v3_norm(arm[k]));
    }
    // interpolate if the error bound allows it
    if (!between) return;
    const size_t n_tangents = cell_tangents(o, w->tangent, list, n, x, radius);
    uint32_t *own = w->list + (list - w->list) + n;
    size_t n_own;
    if (cell_prove(o, x, (const double(*)[3])arm, corner, w->tangent, n_tangents, own, &n_own)) {
        cell_interpolate(w, c, corner);
        return;
    }
    for (int k = 0; k < 8; k++) {
        // one of up to 8 children
        cell child = *c;
        bool empty = false;
        for (int a = 0; a < 3; a++) {
            const int64_t cut = (c->lo[a] + c->hi[a]) / 2;
            // do not split along an axis that has no voxel between the corners
            if (c->hi[a] - c->lo[a] > 1)
                *(k >> a & 1 ? &child.lo[a] : &child.hi[a]) = cut;
            else
                empty = empty || k >> a & 1;
        }
        if (!empty) cell_refine(o, w, origin, &child, own, n_own);
    }
}

/* Writes to list[] the triangles that can be nearest to a point of the top cell, and returns their
 * number. The test uses the distances between the cell centre and the bounding spheres. */
static size_t top_cell_list(const octree *o, const int64_t origin[3], const cell *c, uint32_t *list)
{
    double middle[3], end[3], x[3], radius = 0;
    size_t n = 0;
    for (int a = 0; a < 3; a++) middle[a] = 0.5 * (double)c->hi[a];
    voxel_world(o, origin, middle, x);
    for (int k = 0; k < 8; k++) {
        voxel_world(o, origin,
                    (const double[3]){k & 1 ? (double)c->hi[0] : 0, k & 2 ? (double)c->hi[1] : 0,
                                      k & 4 ? (double)c->hi[2] : 0},
                    end);
        radius = sdm_greater(radius, sqrt(v3_dist2(x, end)));
    }
    const double reach = sdm_exact_distance(o->run->engine, x) + 2 * radius;
    for (size_t t = 0; t < o->run->surface->n_tri; t++) {
        const double far = (reach + o->ball[t][3]) * (1 + 1e-9);
        if (v3_dist2(x, o->ball[t]) <= far * far) list[n++] = (uint32_t)t;
    }
    return n;
}

static void octree_map_top_cell(void *job, int64_t part, int thread)
{
    const octree *o = job;
    const sdm_grid *g = o->run->grid;
    scratch *w = &o->scratch[thread];
    const int64_t block[3] = {part % o->n_top[0], part / o->n_top[0] % o->n_top[1],
                              part / (o->n_top[0] * o->n_top[1])};
    int64_t origin[3], own[3];
    cell c = {.lo = {0, 0, 0}};
    for (int a = 0; a < 3; a++) {
        origin[a] = block[a] * TOP;
        const int64_t left = g->n[a] - 1 - origin[a];
        c.hi[a] = left < TOP ? left : TOP;
        // the last layer of voxels belongs to the next top cell
        own[a] = left > TOP ? TOP : left + 1;
    }
    memset(w->state, UNKNOWN, LATTICE);
    cell_refine(o, w, origin, &c, w->list, top_cell_list(o, origin, &c, w->list));
    for (int64_t k = 0; k < own[2]; k++) {
        for (int64_t j = 0; j < own[1]; j++) {
            float *out =
                o->run->values + ((origin[2] + k) * g->n[1] + origin[1] + j) * g->n[0] + origin[0];
            for (int64_t i = 0; i < own[0]; i++) out[i] = (float)w->value[lattice_number(i, j, k)];
        }
    }
}

static sdm_status octree_prepare(octree *o, sdm_error *err)
{
    sdm_run *run = o->run;
    const sdm_mesh *m = run->surface;
    const size_t threads = (size_t)run->n_threads,
                 a_thread = LATTICE * (sizeof(double) + 1) +
                            m->n_tri * (sizeof(tangent) + (DEPTH + 1) * sizeof(uint32_t));
    sdm_status s = sdm_run_reserve(run, threads, a_thread + sizeof(scratch), err);
    if (!s) s = sdm_run_reserve(run, m->n_tri, sizeof *o->ball, err);
    if (!s) s = SDM_ALLOC(&o->ball, m->n_tri, "balls around triangles", err);
    if (!s) s = SDM_ALLOC(&o->scratch, threads, "octree", err);
    for (size_t i = 0; i < threads && !s; i++) {
        scratch *w = &o->scratch[i];
        s = SDM_ALLOC(&w->value, LATTICE, "octree", err);
        if (!s) s = SDM_ALLOC(&w->state, LATTICE, "octree", err);
        if (!s) s = SDM_ALLOC(&w->tangent, m->n_tri, "octree", err);
        if (!s) s = SDM_ALLOC(&w->list, (DEPTH + 1) * m->n_tri, "octree", err);
    }
    for (size_t t = 0; t < m->n_tri && !s; t++) {
        const double *v[3];
        for (size_t k = 0; k < 3; k++) v[k] = &m->vert[3 * (size_t)m->tri[3 * t + k]];
        for (int a = 0; a < 3; a++) o->ball[t][a] = (v[0][a] + v[1][a] + v[2][a]) / 3;
        for (int k = 0; k < 3; k++)
            o->ball[t][3] = sdm_greater(o->ball[t][3], sqrt(v3_dist2(v[k], o->ball[t])));
    }
    return s;
}

static void octree_dispose(octree *o)
{
    for (int i = 0; o->scratch && i < o->run->n_threads; i++) {
        sdm_free(o->scratch[i].value);
        sdm_free(o->scratch[i].state);
        sdm_free(o->scratch[i].tangent);
        sdm_free(o->scratch[i].list);
    }
    sdm_free(o->scratch);
    sdm_free(o->ball);
}

static sdm_status octree_map(const sdm_mesh *mesh, const sdm_grid *grid,
                             const sdm_method_opts *opts, float *values, sdm_method_report *report,
                             sdm_error *err)
{
    sdm_run run;
    octree o = {.run = &run};
    sdm_frame *frames = NULL;
    sdm_status s = sdm_run_begin(&run, mesh, grid, opts, values, err);
    if (!s) s = sdm_run_frames(&run, &frames, err);
    o.frames = frames;
    if (!s) s = octree_prepare(&o, err);
    // one part of the parallel loop per top cell
    int64_t parts = 1;
    for (int a = 0; a < 3 && !s; a++)
        parts *= o.n_top[a] = grid->n[a] > TOP ? (grid->n[a] - 1 + TOP - 1) / TOP : 1;
    if (!s) {
        sdm_run_prepared(&run);
        // default error: 1/20 of the smallest spacing
        o.max_error = run.opts.max_error_mm;
        if (!(o.max_error > 0))
            o.max_error =
                0.05 * sdm_lesser(grid->spacing[0], sdm_lesser(grid->spacing[1], grid->spacing[2]));
        run.report.error_bound_mm = o.max_error;
        s = sdm_run_parts(&run, parts, octree_map_top_cell, &o, 0, 1, err);
    }
    if (!s) s = sdm_run_sign(&run, err);
    // report
    size_t exact = 0;
    for (int i = 0; i < run.n_threads && !s; i++) exact += o.scratch[i].n_exact;
    if (!s)
        snprintf(run.report.note, sizeof run.report.note,
                 "%zu exact samples for %zu voxels, the others interpolated", exact,
                 sdm_grid_count(grid));
    octree_dispose(&o);
    sdm_free(frames);
    return sdm_run_end(&run, report, s);
}

const sdm_method sdm_method_octree = {
    "octree", "adaptively sampled distances, interpolated within a proved error",
    "Frisken, Perry, Rockwood, Jones 2000", false, octree_map};
