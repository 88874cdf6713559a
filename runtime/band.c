/* Closes a map into the values of a narrow-band level set. */
#include "band.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "sdm/memory.h"

void sdm_band_dispose(sdm_band *b)
{
    sdm_free(b->values);
    memset(b, 0, sizeof *b);
}

static sdm_status reserve(const sdm_grid *grid, int32_t pad, sdm_band *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    out->pad = pad;
    size_t count = 1;
    for (int a = 0; a < 3; a++) {
        out->n[a] = grid->n[a] + 2 * (int64_t)pad;
        const sdm_status s = sdm_mul(count, (size_t)out->n[a], &count, err);
        if (s) return s;
    }
    return SDM_ALLOC(&out->values, count, "level set values", err);
}

static sdm_status check_finite(const sdm_grid *grid, const float *values, sdm_error *err)
{
    const size_t count = sdm_grid_count(grid), nx = (size_t)grid->n[0], ny = (size_t)grid->n[1];
    for (size_t i = 0; i < count; i++)
        if (!isfinite(values[i]))
            return sdm_fail(err, SDM_E_ARG, "value of voxel (%zu, %zu, %zu) is %g, need finite", i % nx, i / nx % ny,
                            i / nx / ny, (double)values[i]);
    return SDM_OK;
}

sdm_status sdm_band_copy(const sdm_grid *grid, const float *values, sdm_band *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    sdm_status s = check_finite(grid, values, err);
    if (!s) s = reserve(grid, 0, out, err);
    if (!s) memcpy(out->values, values, sdm_grid_count(grid) * sizeof *values);
    return s;
}

static size_t at(const int64_t n[3], int64_t i, int64_t j, int64_t k) { return (size_t)((k * n[1] + j) * n[0] + i); }

static bool on_border(const int64_t n[3], int64_t i, int64_t j, int64_t k)
{
    return i == 0 || j == 0 || k == 0 || i == n[0] - 1 || j == n[1] - 1 || k == n[2] - 1;
}

static float border_minimum(const sdm_grid *g, const float *v)
{
    float low = INFINITY;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++)
                if (on_border(g->n, i, j, k)) low = fminf(low, v[at(g->n, i, j, k)]);
    return low;
}

// signed distance (mm) of a voxel centre to the box that the voxels fill; negative inside
static float box_distance(const sdm_grid *g, int64_t i, int64_t j, int64_t k)
{
    const int64_t index[3] = {i, j, k};
    int64_t layer = INT64_MAX;
    for (int a = 0; a < 3; a++) {
        const int64_t near = index[a] < g->n[a] - 1 - index[a] ? index[a] : g->n[a] - 1 - index[a];
        if (near < layer) layer = near;
    }
    return (float)(-((double)layer + 0.5) * g->spacing[0]);
}

// distance at the face point half a voxel beyond border voxel `index` along +-axis, extrapolated; 0 inside the solid
static double face_distance(const sdm_grid *g, const float *v, const int64_t index[3], int axis, int64_t inward)
{
    const double d0 = (double)v[at(g->n, index[0], index[1], index[2])];
    double slope = 0.0;
    if (g->n[axis] > 1) {
        int64_t inner[3] = {index[0], index[1], index[2]};
        inner[axis] += inward;
        slope = 0.5 * (d0 - (double)v[at(g->n, inner[0], inner[1], inner[2])]);
    }
    const double limit = 0.5 * g->spacing[0];
    return fmax(d0 + fmax(-limit, fmin(limit, slope)), 0.0);
}

static int64_t clamp(int64_t x, int64_t low, int64_t high) { return x < low ? low : x > high ? high : x; }

// index i of a face's row of n, counted from the one nearest to p outwards, every other one on the other side; -1: beyond the row
static int64_t outwards(int64_t p, int64_t n, int64_t i)
{
    const int64_t from = clamp(p, 0, n - 1), at = i % 2 ? from - (i + 1) / 2 : from + i / 2;
    return at < n ? at : -1;
}

// of the i-th index: how far it is from p at least, in voxels
static double least_away(int64_t p, int64_t n, int64_t i)
{
    return (double)llabs(p - clamp(p, 0, n - 1)) + (double)((i + 1) / 2);
}

// the least of `best` and, over points b of one face of the box, |p - b| + max(d(b), 0), for p outside the box beyond that face
static double past_face(const sdm_grid *g, const float *v, const int64_t p[3], int axis, double best)
{
    const double h = g->spacing[0];
    const int a1 = (axis + 1) % 3, a2 = (axis + 2) % 3;
    const int64_t n1 = g->n[a1], n2 = g->n[a2];
    const bool low = p[axis] < 0;
    const double away = low ? -0.5 - (double)p[axis] : (double)(p[axis] - g->n[axis]) + 0.5;
    int64_t b[3];
    b[axis] = low ? 0 : g->n[axis] - 1;
    for (int64_t i2 = 0; i2 < 2 * n2; i2++) {
        const double u2 = least_away(p[a2], n2, i2), near2 = fmax(u2 - 0.5, 0.0);
        if (!(h * sqrt(away * away + near2 * near2) < best)) break; // as are all that follow
        b[a2] = outwards(p[a2], n2, i2);
        for (int64_t i1 = 0; i1 < 2 * n1 && b[a2] >= 0; i1++) {
            const double u1 = least_away(p[a1], n1, i1), near1 = fmax(u1 - 0.5, 0.0);
            const double nearest = h * sqrt(away * away + near1 * near1 + near2 * near2);
            if (!(nearest < best)) break;
            b[a1] = outwards(p[a1], n1, i1);
            if (b[a1] < 0) continue;
            const double d = face_distance(g, v, b, axis, low ? 1 : -1);
            // 0: the voxel's whole face belongs to the solid, and the nearest point is one of that square
            best = fmin(best, d > 0 ? h * sqrt(away * away + u1 * u1 + u2 * u2) + d : nearest);
        }
    }
    return best;
}

// distance (mm, at most width) of a voxel outside the grid to the solid inside the grid's box
static float outside_value(const sdm_grid *g, const float *v, const int64_t p[3], double width)
{
    // a map changes by at most its distance: far from the solid nothing has to be searched
    const double nearest =
        (double)v[at(g->n, clamp(p[0], 0, g->n[0] - 1), clamp(p[1], 0, g->n[1] - 1), clamp(p[2], 0, g->n[2] - 1))];
    double best = width;
    if (nearest < 4.0 * width)
        for (int a = 0; a < 3; a++)
            if (p[a] < 0 || p[a] >= g->n[a]) best = past_face(g, v, p, a, best);
    return (float)best;
}

static sdm_status check_jumps(const sdm_band *b, double width, sdm_error *err)
{
    const size_t step[3] = {1, (size_t)b->n[0], (size_t)(b->n[0] * b->n[1])};
    size_t jumps = 0, crossings = 0;
    for (int64_t k = 0; k < b->n[2]; k++)
        for (int64_t j = 0; j < b->n[1]; j++)
            for (int64_t i = 0; i < b->n[0]; i++) {
                const int64_t index[3] = {i, j, k};
                const float *v = &b->values[at(b->n, i, j, k)];
                for (int a = 0; a < 3; a++) {
                    if (index[a] + 1 == b->n[a] || (v[0] < 0) == (v[step[a]] < 0)) continue;
                    crossings++;
                    if (!(fabs((double)v[0]) < width) || !(fabs((double)v[step[a]]) < width)) jumps++;
                }
            }
    if (!crossings)
        return sdm_fail(err, SDM_E_ARG,
                        "no voxel of the map is inside the surface: there is no level set to write; "
                        "use a grid that holds the shape, or write the map itself (--dense)");
    if (jumps)
        return sdm_fail(err, SDM_E_QUALITY,
                        "not a distance map: it jumps across the whole band of %g mm at %zu of its %zu zero crossings",
                        width, jumps, crossings);
    return SDM_OK;
}

sdm_status sdm_band_close(const sdm_grid *g, const float *values, double width, sdm_band *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    sdm_status s = check_finite(g, values, err);
    if (s) return s;
    const float low = border_minimum(g, values);
    const bool cut = low < 0;
    if ((s = reserve(g, (double)low < width ? (int32_t)ceil(width / g->spacing[0]) + 1 : 0, out, err))) return s;
    out->cut = cut;
    const int64_t pad = out->pad;
    for (int64_t k = 0; k < out->n[2]; k++)
        for (int64_t j = 0; j < out->n[1]; j++)
            for (int64_t i = 0; i < out->n[0]; i++) {
                const int64_t p[3] = {i - pad, j - pad, k - pad};
                float *v = &out->values[at(out->n, i, j, k)];
                bool inside = true;
                for (int a = 0; a < 3; a++) inside = inside && p[a] >= 0 && p[a] < g->n[a];
                if (!inside)
                    *v = outside_value(g, values, p, width);
                else if (cut)
                    *v = fmaxf(values[at(g->n, p[0], p[1], p[2])], box_distance(g, p[0], p[1], p[2]));
                else
                    *v = values[at(g->n, p[0], p[1], p[2])];
            }
    return check_jumps(out, width, err);
}
