/* The blocks of a map whose parts have no warp: which parts can be the nearest in a block, and the
   distances to parts that are far away. */
#include <math.h>
#include <string.h>

#include "template_rows.h"

// Half of the diagonal of a block, mm.
static double block_radius(const sdm_grid *grid)
{
    double sum = 0;
    for (int a = 0; a < 3; a++) {
        const double half = 0.5 * (SDM_TEMPLATE_BLOCK - 1) * grid->spacing[a];
        sum += half * half;
    }
    return sqrt(sum);
}

// Bound on how fast the distance to part c changes, mm per mm: 1 for rigid parts. For others the
// product of the largest singular values of m and m^-1, bounded by Frobenius norms.
static double slope_bound(const template_work *w, size_t c)
{
    double forward = 0, back = 0;
    if (sdm_template_is_rigid(w->k, c)) return 1;
    for (int i = 0; i < 9; i++) {
        forward += w->pose[c].m[i] * w->pose[c].m[i];
        back += w->pose[c].inverse[i] * w->pose[c].inverse[i];
    }
    return sqrt(forward * back);
}

// row.u[n] = the indices of n voxels of a row, a block apart, from the voxel index `first`.
// by[a][3]: change of the point (mm) along axis a of the grid.
static void row_points(template_work *w, size_t c, const double first[3], size_t n, float by[3][3])
{
    const affine_part *part = &w->part[c];
    for (int i = 0; i < 3; i++) {
        double u = part->from[i];
        for (int a = 0; a < 3; a++) {
            u += part->by[a][i] * first[a];
            by[a][i] = (float)(w->k->parts[c].near.spacing * part->by[a][i]);
        }
        for (size_t x = 0; x < n; x++)
            w->row.u[i][x] = (float)(u + part->by[0][i] * (double)(x * SDM_TEMPLATE_BLOCK));
    }
}

// out[n][stride] = the values and their gradients in row.g by the axes of the grid.
static void put_row(const template_row *r, const float *value, size_t n, float by[3][3],
                    size_t stride, float *out)
{
    for (size_t x = 0; x < n; x++, out += stride) {
        out[0] = value[x];
        for (int a = 0; a < 3; a++)
            out[1 + a] = by[a][0] * r->g[0][x] + by[a][1] * r->g[1][x] + by[a][2] * r->g[2][x];
    }
}

// w->centre of part c in the row (y, z) of blocks.
static void row_centres(template_work *w, size_t c, size_t y, size_t z)
{
    const double half = 0.5 * (SDM_TEMPLATE_BLOCK - 1),
                 first[3] = {half, half + (double)(y * SDM_TEMPLATE_BLOCK),
                             half + (double)(z * SDM_TEMPLATE_BLOCK)};
    const size_t n_parts = w->k->n_parts, n = w->blocks[0],
                 at = (z * w->blocks[1] + y) * n * n_parts + c;
    const template_row *r = &w->row;
    float by[3][3];
    row_points(w, c, first, n, by);
    sdm_template_lookup(w, c, n);
    if (!w->part[c].rigid) {
        float metric[6];
        sdm_template_metric(w->pose[c].inverse, metric);
        for (int a = 0; a < 6; a++)
            for (size_t x = 0; x < n; x++) r->metric[a][x] = metric[a];
        sdm_template_kernels()->normalise(n, r->f, (const float *const *)r->g,
                                          (const float *const *)r->metric, r->f);
    }
    put_row(r, r->f, n, by, 4 * n_parts, w->centre + 4 * at);
}

// True if the index u[3] lies in a lattice.
static bool is_in(const template_level *l, const float u[3])
{
    bool in = true;
    for (int a = 0; a < 3; a++) {
        const float x = u[a] * l->scale + l->offset[a];
        in &= x >= 0 && x <= (float)(l->n[a] - 1);
    }
    return in;
}

// w->corner of part c in the row (y, z) of corners; NAN for corners outside of the lattice `far`.
static void row_corners(template_work *w, size_t c, size_t y, size_t z)
{
    const double first[3] = {0, (double)(y * SDM_TEMPLATE_BLOCK), (double)(z * SDM_TEMPLATE_BLOCK)};
    const size_t n = w->blocks[0] + 1;
    const template_row *r = &w->row;
    float by[3][3];
    row_points(w, c, first, n, by);
    for (int i = 0; i < 9; i++) by[i / 3][i % 3] *= SDM_TEMPLATE_BLOCK;
    sdm_template_lookup(w, c, n);
    float *out = w->corner + 4 * n * ((c * (w->blocks[2] + 1) + z) * (w->blocks[1] + 1) + y);
    put_row(r, r->f, n, by, 4, out);
    const template_level *far = &w->k->far[c];
    const float first_u[3] = {r->u[0][0], r->u[1][0], r->u[2][0]},
                last_u[3] = {r->u[0][n - 1], r->u[1][n - 1], r->u[2][n - 1]};
    if (is_in(far, first_u) && is_in(far, last_u)) return;
    for (size_t x = 0; x < n; x++)
        if (!is_in(far, (const float[]){r->u[0][x], r->u[1][x], r->u[2][x]})) out[4 * x] = NAN;
}

void sdm_template_blocks(template_work *w)
{
    const size_t n_parts = w->k->n_parts;
    for (size_t c = 0; c < n_parts; c++) {
        w->part[c].slope = slope_bound(w, c);
        for (size_t z = 0; z < w->blocks[2] && n_parts > 1; z++)
            for (size_t y = 0; y < w->blocks[1]; y++) row_centres(w, c, y, z);
        for (size_t z = 0; z <= w->blocks[2] && w->part[c].rigid; z++)
            for (size_t y = 0; y <= w->blocks[1]; y++) row_corners(w, c, y, z);
    }
}

// value[count] = the distance to part c in a block beyond its lattice `near`, from the corners.
// false: one of them is not known.
static bool interpolate(const template_work *w, size_t c, const template_patch *p, float *value)
{
    const size_t *b = w->blocks, line = 4 * (b[0] + 1), plane = line * (b[1] + 1);
    const size_t at[3] = {p->at[0] / SDM_TEMPLATE_BLOCK, p->at[1] / SDM_TEMPLATE_BLOCK,
                          p->at[2] / SDM_TEMPLATE_BLOCK};
    const float *corner = w->corner + (c * (b[2] + 1) + at[2]) * plane + at[1] * line + 4 * at[0];
    const bool whole = p->count == SDM_TEMPLATE_BLOCK_VOXELS;
    float *to = whole ? value : w->row.value;
    sdm_template_kernels()->block(corner, line, plane, to);
    if (isnan(to[0])) return false; // every value is a sum with terms of all corners
    const size_t n = SDM_TEMPLATE_BLOCK;
    for (size_t z = 0; z < p->n[2] && !whole; z++)
        for (size_t y = 0; y < p->n[1]; y++, value += p->n[0])
            memmove(value, to + n * (n * z + y), p->n[0] * sizeof *value);
    return true;
}

// value[count] = the distance to part c in a patch; value may be row.value.
static void part_values(template_work *w, size_t c, const template_patch *p, float *value)
{
    if (!w->by_lines && w->part[c].rigid && sdm_template_place(w, c, p) != TEMPLATE_WITHIN &&
        interpolate(w, c, p, value))
        return;
    sdm_template_run(w, c, p);
    if (value != w->row.value) memcpy(value, w->row.value, p->count * sizeof *value);
}

// The interpolation may change a distance by this much, mm.
static double cull_slack(const template_work *w) { return 0.1 * w->grid->spacing[0]; }

// True if the distance to part c is at least value[] in all voxels of a block, by a lower bound. It
// lies above its tangent at the centre minus the sag; the interpolation may add the slack.
static bool is_behind(const template_work *w, size_t c, const template_patch *p, double radius,
                      const float *value)
{
    const sdm_template_part *part = &w->k->parts[c];
    const float *centre = w->centre + 4 * (p->block * w->k->n_parts + c);
    const double slack = cull_slack(w);
    float base = centre[0], slope[3] = {centre[1], centre[2], centre[3]};
    if (!(base > 0)) return false;
    if (w->part[c].rigid && radius <= part->sag_reach) {
        base -=
            (float)(1.05 * ((double)base >= part->far_from ? part->far_sag : part->sag) + slack);
    } else {
        base -= (float)(1.05 * w->part[c].slope * radius + slack);
        memset(slope, 0, sizeof slope);
    }
    for (int a = 0; a < 3; a++) base -= slope[a] * 0.5f * (float)(SDM_TEMPLATE_BLOCK - 1);
    if (p->count == SDM_TEMPLATE_BLOCK_VOXELS) {
        int32_t count = 0; // of the type of the comparisons, so that the loop is vectorised
        for (size_t v = 0; v < SDM_TEMPLATE_BLOCK_VOXELS; v++)
            count += base + (slope[0] * w->offset[0][v] +
                             (slope[1] * w->offset[1][v] + slope[2] * w->offset[2][v])) >
                     value[v];
        return count == SDM_TEMPLATE_BLOCK_VOXELS;
    }
    bool behind = true;
    for (size_t z = 0; z < p->n[2]; z++)
        for (size_t y = 0; y < p->n[1]; y++, value += p->n[0])
            for (size_t x = 0; x < p->n[0]; x++)
                behind &= base + slope[0] * (float)x + slope[1] * (float)y + slope[2] * (float)z >
                          value[x];
    return behind;
}

// The part that is the nearest at the centre of a block.
static size_t nearest_part(const template_work *w, const template_patch *p)
{
    const float *centre = w->centre + 4 * p->block * w->k->n_parts;
    size_t n = 0;
    for (size_t c = 1; c < w->k->n_parts; c++)
        if (centre[4 * c] < centre[4 * n]) n = c;
    return n;
}

void sdm_template_values(template_work *w, const template_patch *p, float *value, uint8_t *nearest)
{
    const size_t n_parts = w->k->n_parts;
    const bool culled = !w->by_lines && n_parts > 1;
    const size_t first = culled ? nearest_part(w, p) : 0;
    const float *centre = w->centre + 4 * p->block * n_parts;
    // no voxel is nearer to a rigid part that is at least this far from the centre
    const double radius = culled ? block_radius(w->grid) : 0;
    const float far = culled && w->part[first].rigid
                          ? centre[4 * first] + (float)(2 * radius + cull_slack(w))
                          : INFINITY;
    part_values(w, first, p, value);
    if (nearest) memset(nearest, (int)first, p->count);
    for (size_t c = 0; c < n_parts; c++) {
        if (c == first) continue;
        if (culled && ((centre[4 * c] > far && w->part[c].rigid) || is_behind(w, c, p, radius, value)))
            continue;
        part_values(w, c, p, w->row.value);
        for (size_t i = 0; i < p->count && nearest; i++)
            if (w->row.value[i] < value[i]) nearest[i] = (uint8_t)c;
        for (size_t i = 0; i < p->count; i++)
            value[i] = w->row.value[i] < value[i] ? w->row.value[i] : value[i];
    }
}
