/* Evaluates one part of a template network in a block. */
#include <math.h>
#include <string.h>

#include "template_work.h"

enum { BLOCK = SDM_TEMPLATE_STEP, VOXELS = SDM_TEMPLATE_BLOCK_VOXELS };

/* Stations. */

void sdm_template_expand(const template_network *k, const template_block *b, warp_lines *l,
                         size_t n_c, float *const *c)
{
    const size_t nx = k->stations[0], n = nx * k->stations[1], plane = 12 * n, line = 12 * nx;
    const template_table *t = sdm_template_kernels();
    if (l->plane_of != b->at[2]) {
        for (size_t z = 0; z < BLOCK; z++)
            t->combine(&k->expansion, l->points + 4 * n * b->at[2],
                       l->metric + 8 * n * (b->at[2] + 1), n, z, l->plane + z * plane);
        l->plane_of = b->at[2];
        l->line_of = SIZE_MAX;
    }
    if (l->line_of != b->at[1]) {
        for (size_t z = 0; z < BLOCK; z++) {
            const float *from = l->plane + z * plane;
            for (size_t y = 0; y < BLOCK; y++)
                t->combine(&k->expansion, from + 4 * nx * b->at[1],
                           from + 4 * n + 8 * nx * (b->at[1] + 1), nx, y,
                           l->line + (BLOCK * z + y) * line);
        }
        l->line_of = b->at[1];
    }
    t->expand(&k->expansion, l->line + 4 * b->at[0], l->line + 4 * nx + 8 * (b->at[0] + 1), line,
              n_c, c);
}

/* Lookup. */

// The end of the lattice `near`.
typedef struct lattice_end {
    float at[3];
} lattice_end;

static lattice_end end_of_near(const template_work *w, size_t c)
{
    lattice_end end;
    for (int a = 0; a < 3; a++) end.at[a] = (float)(w->k->near[c].n[a] - 1);
    return end;
}

// 1 if the index is within the lattice `near`, else 0.
static int32_t is_near(float *const *u, const lattice_end *end, size_t i)
{
    return (u[0][i] >= 0) & (u[0][i] <= end->at[0]) & (u[1][i] >= 0) & (u[1][i] <= end->at[1]) &
           (u[2][i] >= 0) & (u[2][i] <= end->at[2]);
}

bool sdm_template_is_near(const template_work *w, size_t c, size_t i)
{
    const lattice_end end = end_of_near(w, c);
    return is_near(w->row.u, &end, i);
}

size_t sdm_template_count_near(const template_work *w, size_t c, size_t n)
{
    const lattice_end end = end_of_near(w, c);
    float *const u[3] = {w->row.u[0], w->row.u[1], w->row.u[2]};
    // The counter is as wide as the floats that are compared: the compiler vectorises the loop.
    int32_t count = 0;
    for (size_t i = 0; i < n; i++) count += is_near(u, &end, i);
    return (size_t)count;
}

// Looks up elements from .. to - 1 of row.u. The kernel writes a few elements beyond.
static void lookup_range(const template_work *w, const template_level *l, size_t from, size_t to)
{
    const template_row *r = &w->row;
    const float *const u[3] = {r->u[0] + from, r->u[1] + from, r->u[2] + from};
    float *const g[3] = {r->g[0] + from, r->g[1] + from, r->g[2] + from};
    if (to > from) w->kernels->lookup(l, to - from, u, r->f + from, g);
}

void sdm_template_lookup(const template_work *w, size_t c, size_t n)
{
    const template_row *r = &w->row;
    const template_level *near = &w->k->near[c], *far = &w->k->far[c];
    float *const u[3] = {r->u[0], r->u[1], r->u[2]};
    const lattice_end end = end_of_near(w, c);
    const size_t count = sdm_template_count_near(w, c, n);
    // the run of points within `near`: first .. last - 1
    size_t first = 0, last = n;
    while (first < n && !is_near(u, &end, first)) first++;
    while (last > first && !is_near(u, &end, last - 1)) last--;
    if (count == last - first) {
        // from left to right, because each call writes beyond its end
        lookup_range(w, far, 0, first);
        lookup_range(w, near, first, last);
        lookup_range(w, far, last, n);
        return;
    }
    lookup_range(w, near, 0, n);
    w->kernels->lookup(far, n, (const float *const *)u, r->far_f, r->far_g);
    for (size_t i = 0; i < n; i++) {
        if (is_near(u, &end, i)) continue;
        r->f[i] = r->far_f[i];
        for (int a = 0; a < 3; a++) r->g[a][i] = r->far_g[a][i];
    }
}

// The middle of a block along axis i of the lattice `near` of a part without a warp.
static double block_middle(const part_state *part, const template_block *b, int i)
{
    double middle = part->from[i];
    for (int a = 0; a < 3; a++)
        middle += part->by[a][i] * ((double)(BLOCK * b->at[a]) + 0.5 * (BLOCK - 1));
    return middle;
}

// The indices of a block in the row are rounded to floats: they are at most this far off.
static const double ROUNDING = 1e-4;

static bool is_within(double middle, double extent, double end)
{
    return middle - extent >= ROUNDING && middle + extent <= end - ROUNDING;
}

bool sdm_template_is_within(const template_work *w, size_t c, const template_block *b)
{
    const part_state *part = &w->part[c];
    for (int i = 0; i < 3; i++)
        if (!is_within(block_middle(part, b, i), part->extent[i], w->k->near[c].n[i] - 1))
            return false;
    return true;
}

// The same for a block wholly beyond the lattice.
static bool is_beyond(const template_work *w, size_t c, const template_block *b)
{
    const part_state *part = &w->part[c];
    for (int i = 0; i < 3; i++) {
        const double middle = block_middle(part, b, i), extent = part->extent[i],
                     end = w->k->near[c].n[i] - 1;
        if (middle + extent < -ROUNDING || middle - extent > end + ROUNDING) return true;
    }
    return false;
}

/* Parts. */

size_t sdm_template_max_rows(size_t n)
{
    return n < SDM_TEMPLATE_ROWS_POINTS ? SDM_TEMPLATE_ROWS_POINTS / n : 1;
}

// Looks up the points at .. at + n - 1 of w->row, a line, that lie within the lattice `near`.
static void lookup_line(const template_work *w, size_t c, size_t at, size_t n)
{
    const template_row *r = &w->row;
    const lattice_end end = end_of_near(w, c);
    size_t first = at, last = at + n;
    for (int a = 0; a < 3; a++) {
        const float from = r->u[a][first], to = r->u[a][last - 1];
        if ((from < 0 && to < 0) || (from > end.at[a] && to > end.at[a])) return;
    }
    while (first < last && !is_near(r->u, &end, first)) first++;
    while (last > first && !is_near(r->u, &end, last - 1)) last--;
    if (first == last) return;
    // by other rows, because the kernel writes beyond its end
    const float *const u[3] = {r->u[0] + first, r->u[1] + first, r->u[2] + first};
    w->kernels->lookup(&w->k->near[c], last - first, u, r->far_f, r->far_g);
    memcpy(r->f + first, r->far_f, (last - first) * sizeof *r->f);
    for (int a = 0; a < 3; a++) memcpy(r->g[a] + first, r->far_g[a], (last - first) * sizeof *r->f);
}

void sdm_template_lookup_rows(const template_work *w, size_t c, const template_rows *rows)
{
    const part_state *part = &w->part[c];
    const size_t n = rows->n;
    for (size_t y = 0; y < rows->n_rows; y++)
        for (int i = 0; i < 3; i++) {
            const double at[3] = {rows->first[0], rows->first[1] + (double)(BLOCK * y),
                                  rows->first[2]};
            double u = part->from[i];
            for (int a = 0; a < 3; a++) u += part->by[a][i] * at[a];
            w->kernels->line(n, u, part->by[0][i] * BLOCK, w->row.u[i] + n * y);
        }
    lookup_range(w, &w->k->far[c], 0, n * rows->n_rows);
    for (size_t y = 0; y < rows->n_rows; y++) lookup_line(w, c, n * y, n);
}

void sdm_template_tangents(const template_work *w, size_t c, size_t n, float step, size_t stride,
                           float *out)
{
    const template_row *r = &w->row;
    float by[3][3];
    for (int a = 0; a < 3; a++)
        for (int i = 0; i < 3; i++)
            by[a][i] = step * (float)(w->k->parts[c].near.spacing * w->part[c].by[a][i]);
    w->kernels->tangents(n, r->f, (const float *const *)r->g, (const float(*)[3])by, stride, out);
}

void sdm_template_affine(const template_work *w, const double from[3], const double by[3][3],
                         const template_block *b, float *const u[3])
{
    for (int i = 0; i < 3; i++) {
        double at = from[i];
        for (int a = 0; a < 3; a++) at += by[a][i] * (double)(BLOCK * b->at[a]);
        const float first = (float)at, bx = (float)by[0][i], by_y = (float)by[1][i],
                    bz = (float)by[2][i];
        for (size_t v = 0; v < VOXELS; v++)
            u[i][v] =
                first + (bx * w->offset[0][v] + (by_y * w->offset[1][v] + bz * w->offset[2][v]));
    }
}

void sdm_template_points(template_work *w, size_t c, const template_block *b)
{
    const part_state *part = &w->part[c];
    template_row *r = &w->row;
    w->loaded = SIZE_MAX;
    if (part->warped) {
        float *const to[9] = {r->u[0],      r->u[1],      r->u[2],      r->metric[0], r->metric[1],
                              r->metric[2], r->metric[3], r->metric[4], r->metric[5]};
        sdm_template_expand(w->k, b, &w->lines[c], 9, to);
        return;
    }
    sdm_template_affine(w, part->from, part->by, b, r->u);
    if (part->rigid) return;
    float metric[6];
    sdm_template_metric(w->pose[c].inverse, metric);
    for (int a = 0; a < 6; a++)
        for (size_t v = 0; v < VOXELS; v++) r->metric[a][v] = metric[a];
}

void sdm_template_run(template_work *w, size_t c, const template_block *b)
{
    template_row *r = &w->row;
    const template_network *k = w->k;
    const template_table *t = w->kernels;
    sdm_template_points(w, c, b);
    w->loaded = c;
    if (!w->part[c].warped && sdm_template_is_within(w, c, b))
        lookup_range(w, &k->near[c], 0, VOXELS);
    else if (!w->part[c].warped && is_beyond(w, c, b))
        lookup_range(w, &k->far[c], 0, VOXELS);
    else
        sdm_template_lookup(w, c, VOXELS);
    if (w->part[c].rigid)
        memcpy(r->value, r->f, VOXELS * sizeof *r->value);
    else
        t->normalise(VOXELS, r->f, (const float *const *)r->g, (const float *const *)r->metric,
                     r->value);
    if (w->correction_at.map && c == 0)
        t->correct(&w->correction_at, VOXELS, (const float *const *)r->u, r->value);
}
