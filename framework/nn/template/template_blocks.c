/* The values of a block: which parts can be the nearest in it, and how each of them is evaluated.
 */
#include <math.h>
#include <string.h>

#include "template_work.h"

enum { BLOCK = SDM_TEMPLATE_STEP, VOXELS = SDM_TEMPLATE_BLOCK_VOXELS };

// The interpolation may change a distance by this much, mm.
static double cull_slack(const template_work *w) { return 0.1 * w->grid->spacing[0]; }

// Returns the distances to part c in a block: value[64], or w->row.value.
static const float *part_values(template_work *w, size_t c, const template_block *b, float *value)
{
    const float share = sdm_template_far(w, c, b, value);
    if (share == 1) return value;
    sdm_template_run(w, c, b);
    if (share == 0) return w->row.value;
    sdm_template_blend(share, value, w->row.value, value);
    return value;
}

// value[64] = the distances to part c in a block.
static void first_values(template_work *w, size_t c, const template_block *b, float *value)
{
    const float *from = part_values(w, c, b, value);
    if (from != value) memcpy(value, from, VOXELS * sizeof *value);
}

/* Centres. */

// Bound on how fast the distance to part c changes, mm per mm: 1 for rigid parts. For affine ones
// the product of the largest singular values of m and m^-1, bounded by Frobenius norms.
static double slope_bound(const template_work *w, size_t c)
{
    double forward = 0, back = 0;
    if (w->part[c].rigid) return 1;
    for (int i = 0; i < 9; i++) {
        forward += w->pose[c].m[i] * w->pose[c].m[i];
        back += w->pose[c].inverse[i] * w->pose[c].inverse[i];
    }
    return sqrt(forward * back);
}

// w->centre of part c, which has no warp.
static void affine_centres(template_work *w, size_t c)
{
    const template_row *r = &w->row;
    const size_t n_parts = w->k->n_parts, n = w->blocks[0], all = w->blocks[1],
                 most = sdm_template_max_rows(n);
    const double half = 0.5 * (BLOCK - 1);
    float metric[6], *out = w->centre + 4 * c;
    sdm_template_metric(w->pose[c].inverse, metric);
    for (size_t z = 0; z < w->blocks[2]; z++)
        for (size_t y = 0; y < all; y += most) {
            const template_rows rows = {
                .first = {half, half + (double)(BLOCK * y), half + (double)(BLOCK * z)},
                .n = n,
                .n_rows = all - y < most ? all - y : most};
            const size_t count = n * rows.n_rows;
            sdm_template_lookup_rows(w, c, &rows);
            if (!w->part[c].rigid) {
                for (int a = 0; a < 6; a++)
                    for (size_t i = 0; i < count; i++) r->metric[a][i] = metric[a];
                w->kernels->normalise(count, r->f, (const float *const *)r->g,
                                      (const float *const *)r->metric, r->f);
            }
            sdm_template_tangents(w, c, count, 1, 4 * n_parts, out);
            out += 4 * n_parts * count;
        }
}

// The same for a part with a warp: the mean of the corners.
static void warped_centres(template_work *w, size_t c)
{
    template_block b = sdm_template_first_block(w);
    do {
        const float *corner = w->corner + 4 * sdm_template_corner_at(w, c, &b);
        float sum = 0;
        for (size_t k = 0; k < 8; k++) sum += corner[4 * sdm_template_corner_step(w, k)];
        w->centre[4 * (b.number * w->k->n_parts + c)] = sum / 8;
    } while (sdm_template_next_block(w, &b));
}

void sdm_template_centres(template_work *w, size_t c)
{
    if (w->part[c].warped) {
        warped_centres(w, c);
        return;
    }
    w->part[c].slope = slope_bound(w, c);
    affine_centres(w, c);
}

// True if the distance to part c is at least value[] in all voxels of a block, by a lower bound. It
// lies above its tangent at the centre minus the sag; the interpolation may add the slack. There is
// no bound for parts with a warp.
static bool is_behind(const template_work *w, size_t c, const template_block *b, double radius,
                      const float *value)
{
    const sdm_template_part *part = &w->k->parts[c];
    const float *centre = w->centre + 4 * (b->number * w->k->n_parts + c);
    const double slack = cull_slack(w);
    float base = centre[0], slope[3] = {centre[1], centre[2], centre[3]};
    if (w->part[c].warped || !(base > 0)) return false;
    if (w->part[c].rigid && radius <= part->sag_reach) {
        base -=
            (float)(1.05 * ((double)base >= part->far_from ? part->far_sag : part->sag) + slack);
    } else {
        base -= (float)(1.05 * w->part[c].slope * radius + slack);
        memset(slope, 0, sizeof slope);
    }
    for (int a = 0; a < 3; a++) base -= slope[a] * 0.5f * (float)(BLOCK - 1);
    return w->kernels->is_above(base, slope, value);
}

// The part that is the nearest at the centre of a block.
static size_t nearest_part(const template_work *w, const template_block *b)
{
    const float *centre = w->centre + 4 * b->number * w->k->n_parts;
    size_t n = 0;
    for (size_t c = 1; c < w->k->n_parts; c++)
        if (centre[4 * c] < centre[4 * n]) n = c;
    return n;
}

void sdm_template_values(template_work *w, const template_block *b, float *value, uint8_t *nearest)
{
    const size_t n_parts = w->k->n_parts;
    w->loaded = SIZE_MAX;
    if (n_parts == 1) {
        first_values(w, 0, b, value);
        if (nearest) memset(nearest, 0, VOXELS);
        return;
    }
    const size_t first = nearest_part(w, b);
    const float *centre = w->centre + 4 * b->number * n_parts;
    // no voxel is nearer to a rigid part that is at least this far from the centre
    const double radius = w->block_radius;
    const float far =
        w->part[first].rigid ? centre[4 * first] + (float)(2 * radius + cull_slack(w)) : INFINITY;
    first_values(w, first, b, value);
    if (nearest) memset(nearest, (int)first, VOXELS);
    for (size_t c = 0; c < n_parts; c++) {
        if (c == first || (centre[4 * c] > far && w->part[c].rigid) ||
            is_behind(w, c, b, radius, value))
            continue;
        float interpolated[VOXELS];
        const float *other = part_values(w, c, b, interpolated);
        for (size_t v = 0; v < VOXELS && nearest; v++)
            if (other[v] < value[v]) nearest[v] = (uint8_t)c;
        w->kernels->take_lesser(other, value);
    }
}
