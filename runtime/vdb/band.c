/* Turns a map into the values of a narrow-band level set. */
#include "band.h"

#include <math.h>
#include <string.h>

#include "faces.h"
#include "sdm/internal/heap.h"

void sdm_band_dispose(sdm_band *b)
{
    sdm_free(b->values);
    memset(b, 0, sizeof *b);
}

/* Allocates values for the grid with a margin of `pad` voxels. */
static sdm_status band_reserve(const sdm_grid *grid, int32_t pad, sdm_band *out, sdm_error *err)
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
            return sdm_fail(err, SDM_E_ARG, "value of voxel (%zu, %zu, %zu) is %g, need finite",
                            i % nx, i / nx % ny, i / nx / ny, (double)values[i]);
    return SDM_OK;
}

sdm_status sdm_band_copy(const sdm_grid *grid, const float *values, sdm_band *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    sdm_status s = check_finite(grid, values, err);
    if (!s) s = band_reserve(grid, 0, out, err);
    if (!s) memcpy(out->values, values, sdm_grid_count(grid) * sizeof *values);
    return s;
}

static size_t at(const int64_t n[3], int64_t i, int64_t j, int64_t k)
{
    return (size_t)((k * n[1] + j) * n[0] + i);
}

static bool on_border(const int64_t n[3], int64_t i, int64_t j, int64_t k)
{
    return i == 0 || j == 0 || k == 0 || i == n[0] - 1 || j == n[1] - 1 || k == n[2] - 1;
}

/* Smallest value on the border of the grid; negative: the surface leaves the grid. */
static float border_minimum(const sdm_grid *g, const float *v)
{
    float low = INFINITY;
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++)
                if (on_border(g->n, i, j, k)) low = fminf(low, v[at(g->n, i, j, k)]);
    return low;
}

/* Signed distance (mm, negative) of the centre of voxel (i, j, k) of the grid to the surface of the
   box that the voxels fill. */
static float box_distance(const sdm_grid *g, int64_t i, int64_t j, int64_t k)
{
    const int64_t index[3] = {i, j, k};
    int64_t layer = INT64_MAX;
    for (int a = 0; a < 3; a++) {
        const int64_t to_border =
            index[a] < g->n[a] - 1 - index[a] ? index[a] : g->n[a] - 1 - index[a];
        if (to_border < layer) layer = to_border;
    }
    return (float)(-((double)layer + 0.5) * g->spacing[0]);
}

/* Demands that neighbours differ in sign somewhere (SDM_E_ARG), and that both values then lie
   inside the band, as in every distance map (SDM_E_QUALITY). */
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
                    if (!(fabs((double)v[0]) < width) || !(fabs((double)v[step[a]]) < width))
                        jumps++;
                }
            }
    if (!crossings)
        return sdm_fail(
            err, SDM_E_ARG,
            "no voxel of the map is inside the surface: there is no level set to write; "
            "use a grid that holds the shape, with smaller voxels, or write the map itself "
            "(sdm_vdb_opts.dense)");
    if (jumps)
        return sdm_fail(err, SDM_E_QUALITY,
                        "not a distance map: it jumps across the whole band of %g mm at %zu of its "
                        "%zu zero crossings",
                        width, jumps, crossings);
    return SDM_OK;
}

/* Sets one row of values: inside the grid those of the map, cut off at the border if out->cut;
   outside, the distance from the faces; faces == NULL: the values outside are there. */
static void close_row(const sdm_grid *g, const float *values, double width, int64_t j, int64_t k,
                      sdm_faces *faces, sdm_band *out)
{
    const int64_t pad = out->pad;
    for (int64_t i = 0; i < out->n[0]; i++) {
        const int64_t p[3] = {i - pad, j - pad, k - pad};
        float *v = &out->values[at(out->n, i, j, k)];
        bool inside = true;
        for (int a = 0; a < 3; a++) inside = inside && p[a] >= 0 && p[a] < g->n[a];
        if (!inside && faces) {
            *v = (float)sdm_faces_distance(faces, p, width);
            out->estimated += (double)*v < width;
        } else if (!inside)
            continue; // the padding is the map
        else if (out->cut)
            *v = fmaxf(values[at(g->n, p[0], p[1], p[2])], box_distance(g, p[0], p[1], p[2]));
        else
            *v = values[at(g->n, p[0], p[1], p[2])];
    }
}

/* Fills the padded box with the map that opts->map() makes there. */
static sdm_status map_padding(const sdm_grid *g, const sdm_vdb_opts *opts, sdm_band *out,
                              sdm_error *err)
{
    const double first[3] = {-out->pad, -out->pad, -out->pad};
    sdm_grid padded = *g;
    sdm_grid_world(g, first, padded.origin);
    for (int a = 0; a < 3; a++) padded.n[a] = out->n[a];
    const sdm_status s = opts->map(opts->user, &padded, out->values, err);
    if (s) return s;
    return check_finite(&padded, out->values, err);
}

sdm_status sdm_band_close(const sdm_grid *g, const float *values, double width,
                          const sdm_vdb_opts *opts, sdm_band *out, sdm_error *err)
{
    memset(out, 0, sizeof *out);
    sdm_status s = check_finite(g, values, err);
    if (s) return s;
    const float low = border_minimum(g, values);
    sdm_faces faces = {0};
    s = band_reserve(g, (double)low < width ? (int32_t)ceil(width / g->spacing[0]) + 1 : 0, out,
                     err);
    out->cut = low < 0;
    const bool by_map = out->pad && !out->cut && opts->map;
    if (!s && by_map) s = map_padding(g, opts, out, err);
    if (!s && out->pad && !by_map) s = sdm_faces_create(g, values, &faces, err);
    for (int64_t k = 0; k < out->n[2] && !s; k++) {
        if (opts->cancelled && opts->cancelled(opts->user))
            s = sdm_fail(err, SDM_E_CANCELLED, "level set stopped on request");
        for (int64_t j = 0; j < out->n[1] && !s; j++)
            close_row(g, values, width, j, k, by_map ? NULL : &faces, out);
    }
    sdm_faces_dispose(&faces);
    return s ? s : check_jumps(out, width, err);
}
