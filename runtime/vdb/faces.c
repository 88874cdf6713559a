/* Finds the minimum over the points of a face by branch and bound over squares of points (Land and
   Doig 1960): a square is skipped if its lower bound is not below the minimum so far. */
#include "faces.h"

#include <math.h>
#include <stdbool.h>
#include <string.h>

#include "sdm/memory.h"

/* max(d, 0), mm, at the point of the face half a voxel beyond border voxel `index` along `axis`: d
   is extrapolated linearly, by half a voxel edge at most. inward: direction of the grid's inside, 1
   or -1. */
static double face_distance(const sdm_grid *g, const float *v, const int64_t index[3], int axis,
                            int64_t inward)
{
    const size_t step[3] = {1, (size_t)g->n[0], (size_t)(g->n[0] * g->n[1])};
    const size_t at = (size_t)index[0] + (size_t)index[1] * step[1] + (size_t)index[2] * step[2];
    const double d0 = (double)v[at];
    double slope = 0.0;
    if (g->n[axis] > 1)
        slope = 0.5 * (d0 - (double)v[inward > 0 ? at + step[axis] : at - step[axis]]);
    const double limit = 0.5 * g->spacing[0];
    return fmax(d0 + fmax(-limit, fmin(limit, slope)), 0.0);
}

/* Level 0 of a face. */
static void face_fill_points(const sdm_grid *g, const float *v, int axis, bool low, sdm_face *f)
{
    const int a = (axis + 1) % 3, b = (axis + 2) % 3;
    int64_t index[3];
    index[axis] = low ? 0 : g->n[axis] - 1;
    double *d = f->min[0];
    for (index[b] = 0; index[b] < g->n[b]; index[b]++)
        for (index[a] = 0; index[a] < g->n[a]; index[a]++)
            *d++ = face_distance(g, v, index, axis, low ? 1 : -1);
}

/* Level `level` of a face: minima over 2 x 2 squares of the level below. */
static void face_fill_squares(sdm_face *f, int level)
{
    const int64_t *fine = f->n[level - 1], *n = f->n[level];
    for (int64_t i = 0; i < n[0] * n[1]; i++) f->min[level][i] = INFINITY;
    for (int64_t j = 0; j < fine[1]; j++)
        for (int64_t i = 0; i < fine[0]; i++) {
            double *min = &f->min[level][j / 2 * n[0] + i / 2];
            *min = fmin(*min, f->min[level - 1][j * fine[0] + i]);
        }
}

static sdm_status face_create(const sdm_grid *g, const float *v, int axis, bool low, sdm_face *f,
                              sdm_error *err)
{
    f->n[0][0] = g->n[(axis + 1) % 3];
    f->n[0][1] = g->n[(axis + 2) % 3];
    for (f->levels = 1;; f->levels++) {
        const int level = f->levels - 1;
        const sdm_status s = SDM_ALLOC(&f->min[level], (size_t)(f->n[level][0] * f->n[level][1]),
                                       "faces of a level set", err);
        if (s) return s;
        if (level == 0)
            face_fill_points(g, v, axis, low, f);
        else
            face_fill_squares(f, level);
        if (f->n[level][0] == 1 && f->n[level][1] == 1) return SDM_OK;
        for (int k = 0; k < 2; k++) f->n[level + 1][k] = (f->n[level][k] + 1) / 2;
    }
}

sdm_status sdm_faces_create(const sdm_grid *g, const float *values, sdm_faces *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    out->voxel = g->spacing[0];
    sdm_status s = SDM_OK;
    for (int a = 0; a < 3; a++) out->n[a] = g->n[a];
    for (int i = 0; i < 6 && !s; i++)
        s = face_create(g, values, i / 2, i % 2 == 0, &out->face[i], err);
    return s;
}

void sdm_faces_dispose(sdm_faces *f)
{
    for (int i = 0; i < 6; i++)
        for (int level = 0; level < SDM_FACE_LEVELS; level++) sdm_free(f->face[i].min[level]);
    memset(f, 0, sizeof *f);
}

/* A voxel outside the grid, seen from a face; lengths are in voxels unless stated. */
typedef struct view {
    double voxel, away; // edge of a voxel, mm; distance to the plane of the face
    int64_t p[2];       // position along the face
} view;

/* Lower bound of |p - b| + max(d(b), 0) over the points of square `at` of a level; on level 0 the
   value itself. */
static double square_bound(const sdm_face *f, const view *v, int level, const int64_t at[2])
{
    const double d = f->min[level][at[1] * f->n[level][0] + at[0]];
    double u[2];
    for (int k = 0; k < 2; k++) {
        const int64_t size = (int64_t)1 << level, from = at[k] * size, end = from + size - 1;
        const int64_t to = end < f->n[0][k] ? end : f->n[0][k] - 1;
        u[k] = v->p[k] < from ? (double)(from - v->p[k])
               : v->p[k] > to ? (double)(v->p[k] - to)
                              : 0;
        // d = 0: the whole voxel face belongs to the solid, so the nearest point may lie half a
        // voxel closer
        if (!(d > 0)) u[k] = fmax(u[k] - 0.5, 0.0);
    }
    return v->voxel * sqrt(v->away * v->away + u[0] * u[0] + u[1] * u[1]) + d;
}

/* The smaller one of `best` and the minimum over the points of a square. */
static double square_search(sdm_face *f, const view *v, int level, const int64_t at[2], double best)
{
    const double low = square_bound(f, v, level, at);
    if (!(low < best)) return best;
    if (level == 0) {
        memcpy(f->last, at, sizeof f->last);
        return low;
    }
    const int64_t *n = f->n[level - 1];
    for (int k = 0; k < 4; k++) {
        const int64_t part[2] = {2 * at[0] + k % 2, 2 * at[1] + k / 2};
        if (part[0] < n[0] && part[1] < n[1]) best = square_search(f, v, level - 1, part, best);
    }
    return best;
}

double sdm_faces_distance(sdm_faces *f, const int64_t p[3], double max)
{
    double best = max;
    for (int a = 0; a < 3; a++) {
        if (p[a] >= 0 && p[a] < f->n[a]) continue;
        sdm_face *face = &f->face[2 * a + (p[a] >= 0)];
        const view v = {.voxel = f->voxel,
                        .away = p[a] < 0 ? -0.5 - (double)p[a] : (double)(p[a] - f->n[a]) + 0.5,
                        .p = {p[(a + 1) % 3], p[(a + 2) % 3]}};
        const int64_t top[2] = {0, 0};
        // start with the nearest point of the last search
        best = fmin(best, square_bound(face, &v, 0, face->last));
        best = square_search(face, &v, face->levels - 1, top, best);
    }
    return best;
}
