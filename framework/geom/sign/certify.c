/* Certificate of a map's signs: recomputes them from crossings along other axes of the grid, or
 * from sums of solid angles over all triangles, and counts the differences. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "memory/cancel.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "sign.h"
#include "sign_rows.h"

/* The comparison of one map; `rows` is set for each axis in turn. */
typedef struct certify_job {
    const sdm_sign_rows *rows;
    const float *values;
    const int64_t *n; // voxels of the grid along x, y, z
    double rounding;  // voxels with abs(distance) <= rounding are not compared, mm
    // [nz][ny][pitch] one bit per voxel, set if a recomputed sign differs from the map; no two
    // threads write to the same byte
    uint8_t *wrong;
    // laid out like `wrong`: one bit per voxel, set if its winding number is < -1/2
    uint8_t *below;
    size_t pitch;
} certify_job;

static void row_compare(certify_job *c, size_t row, const int64_t start[3], int64_t i0, int64_t i1,
                        const int32_t *base)
{
    const int axis = c->rows->rows.axis[0];
    int64_t at[3] = {start[0], start[1], start[2]};
    for (sdm_row_span u = sdm_row_spans(&c->rows->rows, row); sdm_row_span_next(&u);) {
        int64_t end;
        for (sdm_row_span_clip(&u, i0, i1, &at[axis], &end); at[axis] < end; at[axis]++) {
            const int64_t line = at[2] * c->n[1] + at[1];
            const float d = c->values[line * c->n[0] + at[0]];
            const int32_t winding = u.winding + (base ? base[at[axis] - i0] : 0);
            const size_t byte = (size_t)line * c->pitch + (size_t)(at[0] / 8);
            if (fabs((double)d) <= c->rounding) continue;
            if (isnan(d) || (d < 0) != (winding >= 1)) c->wrong[byte] |= (uint8_t)(1 << at[0] % 8);
            if (winding < 0) c->below[byte] |= (uint8_t)(1 << at[0] % 8);
        }
    }
}

static void tile_compare(void *user, const sdm_row_tile *t, const int32_t *base)
{
    certify_job *c = user;
    const sdm_rows *r = &c->rows->rows;
    for (int64_t k = t->k0; k < t->k1; k++) {
        for (int64_t j = t->j0; j < t->j1; j++) {
            int64_t start[3] = {0, 0, 0};
            start[r->axis[1]] = j;
            start[r->axis[2]] = k;
            row_compare(c, (size_t)(k * r->n[1] + j), start, t->i0, t->i1, base);
            if (base) base += t->i1 - t->i0;
        }
    }
}

static sdm_status axis_compare(certify_job *c, const sdm_sign *s, const sdm_grid *g,
                               const int axis[3], const sdm_exact_opts *opts, sdm_error *err)
{
    sdm_sign_rows rows = {0};
    const sdm_boundary *b = s->survey->audit.closed ? NULL : &s->winding.boundary;
    sdm_status st = sdm_sign_rows_build(s->solid, b, g, axis, opts, &rows, err);
    c->rows = &rows;
    if (!st) st = sdm_sign_tiles(&rows, rows.rows.n[1], rows.rows.n[2], opts, tile_compare, c, err);
    sdm_rows_dispose(&rows.rows);
    return st;
}

static void voxel_mark(uint8_t *bits, const certify_job *c, int64_t voxel)
{
    const int64_t line = voxel / c->n[0], i = voxel % c->n[0];
    bits[(size_t)line * c->pitch + (size_t)(i / 8)] |= (uint8_t)(1 << i % 8);
}

/* Recomputes the winding number by a sum over all triangles at voxels drawn evenly from the map.
 * *n: on input the number of voxels of the map, on output the number of voxels drawn. */
static sdm_status sums_compare(certify_job *c, const sdm_sign *s, const sdm_grid *g,
                               const sdm_exact_opts *opts, size_t *n, sdm_error *err)
{
    const size_t n_voxel = *n, most = 20000000 / s->solid->n_tri + 100,
                 n_sample = most < n_voxel ? most : n_voxel;
    *n = n_sample;
    for (size_t i = 0; i < n_sample; i++) {
        if (sdm_cancelled(opts))
            return sdm_fail(err, SDM_E_CANCELLED, "certificate stopped on request");
        const double place =
            ((double)i + sdm_rng_uniform(1, 1, i)) * ((double)n_voxel / (double)n_sample);
        const int64_t voxel = place < (double)n_voxel ? (int64_t)place : (int64_t)n_voxel - 1;
        const double index[3] = {(double)(voxel % g->n[0]), (double)(voxel / g->n[0] % g->n[1]),
                                 (double)(voxel / g->n[0] / g->n[1])};
        double x[3];
        sdm_grid_world(g, index, x);
        const double w = sdm_winding_sum(&s->winding, x);
        const float d = c->values[voxel];
        if (fabs((double)d) <= c->rounding) continue;
        if (isnan(d) || (d < 0) != (w > 0.5)) voxel_mark(c->wrong, c, voxel);
        if (w < -0.5) voxel_mark(c->below, c, voxel);
    }
    return SDM_OK;
}

/* Is the winding number 1/2 up to rounding, so that the sign is undefined? Only possible for open
 * meshes. */
static bool voxel_undecided(const sdm_sign *s, const sdm_grid *g, const int64_t at[3])
{
    if (s->survey->audit.closed) return false;
    const double index[3] = {(double)at[0], (double)at[1], (double)at[2]};
    double x[3];
    sdm_grid_world(g, index, x);
    return fabs(sdm_winding_number(&s->winding, x) - 0.5) < 1e-9;
}

static void bits_count(const certify_job *c, const sdm_sign *s, const sdm_grid *g,
                       sdm_sign_certificate *out)
{
    for (int64_t line = 0; line < c->n[1] * c->n[2]; line++) {
        for (size_t byte = 0; byte < c->pitch; byte++) {
            const unsigned wrong = c->wrong[(size_t)line * c->pitch + byte];
            const unsigned below = c->below[(size_t)line * c->pitch + byte];
            for (unsigned b = 0; (wrong | below) >> b; b++) {
                const int64_t at[3] = {(int64_t)(8 * byte + b), line % c->n[1], line / c->n[1]};
                out->below_zero += below >> b & 1;
                if (!(wrong >> b & 1)) continue;
                if (!isnan(c->values[line * c->n[0] + at[0]]) && voxel_undecided(s, g, at))
                    continue;
                if (!out->wrong++) memcpy(out->first_wrong, at, sizeof at);
            }
        }
    }
}

sdm_status sdm_sign_certify(const sdm_sign *s, const sdm_grid *g, const sdm_exact_opts *opts,
                            double rounding, const float *values, sdm_sign_certificate *out,
                            sdm_error *err)
{
    static const int axes[3][3] = {{0, 1, 2}, {1, 0, 2}, {2, 0, 1}};
    const bool closed = s->survey->audit.closed;
    const bool by_rows = closed || sdm_sign_fits_rows(s->method, &s->winding.boundary);
    // pseudo-normals do not use crossings, so all three axes are independent of the map
    const bool three = s->method == SDM_SIGN_PSEUDONORMAL;
    const size_t n = sdm_grid_count(g);
    // pad lines of bits to 16 voxels: tiles of rows along y or z start at multiples of 16 in x, so
    // threads never share a byte
    certify_job c = {.values = values,
                     .n = g->n,
                     .rounding = rounding,
                     .pitch = (size_t)((g->n[0] + 15) / 16) * 2};
    // the two bit fields count towards memory_limit
    const size_t n_byte = (size_t)(g->n[1] * g->n[2]) * c.pitch;
    *out = (sdm_sign_certificate){.method = s->method, .first_wrong = {-1, -1, -1}, .voxels = n};
    if (opts->memory_limit && 2 * n_byte >= opts->memory_limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "the certificate needs %zu bytes, memory_limit leaves %zu", 2 * n_byte,
                        opts->memory_limit);
    // options for the recomputation: memory_limit without the bytes of the bit fields
    sdm_exact_opts beside = *opts;
    if (beside.memory_limit) beside.memory_limit -= 2 * n_byte;
    sdm_status st = SDM_ALLOC(&c.wrong, n_byte, "compared signs", err);
    if (!st) st = SDM_ALLOC(&c.below, n_byte, "compared signs", err);
    // recompute and compare the signs
    for (int a = three ? 0 : 1; a < 3 && by_rows && !st; a++)
        st = axis_compare(&c, s, g, axes[a], &beside, err);
    out->checked = n;
    if (!st && !by_rows) st = sums_compare(&c, s, g, opts, &out->checked, err);
    out->compared = !by_rows ? "sums of solid angles"
                    : three  ? "crossings along x, y and z"
                    : closed ? "crossings along y and z"
                             : "crossings along y and z and the boundary";
    if (!st) bits_count(&c, s, g, out);
    sdm_free(c.wrong);
    sdm_free(c.below);
    return st;
}
