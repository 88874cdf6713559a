/* The distances to a part of a template network at the corners of the blocks, from which blocks far
   from the part are interpolated. */
#include <math.h>

#include "template_work.h"

enum { BLOCK = SDM_TEMPLATE_STEP };

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

// Sets the distance at the n corners of a row, the points at .. at + n - 1 of w->row, to NAN
// outside of the lattice `far`.
static void forget_outside(const template_work *w, size_t c, size_t at, size_t n, float *corner)
{
    const template_level *far = &w->k->far[c];
    float *const *u = w->row.u;
    const size_t last = at + n - 1;
    if (is_in(far, (const float[]){u[0][at], u[1][at], u[2][at]}) &&
        is_in(far, (const float[]){u[0][last], u[1][last], u[2][last]}))
        return;
    for (size_t x = 0; x < n; x++)
        if (!is_in(far, (const float[]){u[0][at + x], u[1][at + x], u[2][at + x]}))
            corner[4 * x] = NAN;
}

/* Rigid parts: points on a regular lattice. */

static void rigid_corners(const template_work *w, size_t c, float *corner)
{
    const size_t n = w->blocks[0] + 1, all = w->blocks[1] + 1, most = sdm_template_max_rows(n);
    for (size_t z = 0; z <= w->blocks[2]; z++)
        for (size_t y = 0; y < all; y += most) {
            const template_rows rows = {.first = {0, (double)(BLOCK * y), (double)(BLOCK * z)},
                                        .n = n,
                                        .n_rows = all - y < most ? all - y : most};
            sdm_template_lookup_rows(w, c, &rows);
            sdm_template_tangents(w, c, n * rows.n_rows, BLOCK, 4, corner);
            for (size_t row = 0; row < rows.n_rows; row++, corner += 4 * n)
                forget_outside(w, c, n * row, n, corner);
        }
}

/* Parts with a warp: the corners are stations. The distance is f s + r with the template f, the
   factor s of the metric and the correction r. The gradients of the carried points, of s and of r
   are central differences between stations. */

// The samples of row (y, z) of stations.
static void sample_row(template_work *w, size_t c, size_t first, size_t n)
{
    const float *points = w->warp[c].points + 4 * first, *metric = w->warp[c].metric + 8 * first;
    const template_table *t = w->kernels;
    const template_row *r = &w->row;
    float *out = w->warp[c].sample + SAMPLE_SIZE * first;
    for (size_t x = 0; x < n; x++) {
        for (size_t a = 0; a < 3; a++) r->u[a][x] = points[4 * x + a];
        for (size_t a = 0; a < 6; a++) r->metric[a][x] = metric[8 * x + a];
        r->value[x] = 1;
        r->far_f[x] = 0;
    }
    sdm_template_lookup(w, c, n);
    t->normalise(n, r->value, (const float *const *)r->g, (const float *const *)r->metric,
                 r->value);
    for (size_t x = 0; x < n; x++) r->far_f[x] = 0; // lookup may have used it
    if (w->correction_at.map && c == 0)
        t->correct(&w->correction_at, n, (const float *const *)r->u, r->far_f);
    for (size_t x = 0; x < n; x++, out += SAMPLE_SIZE) {
        out[SAMPLE_F] = r->f[x];
        for (size_t a = 0; a < 3; a++) out[SAMPLE_G + a] = r->g[a][x];
        out[SAMPLE_S] = r->value[x];
        out[SAMPLE_R] = r->far_f[x];
    }
}

// The corner at a station; stride[a]: stations between neighbours along axis a.
static void warped_corner(const template_work *w, size_t c, size_t at, const size_t stride[3],
                          float corner[4])
{
    const float *p = w->warp[c].points, *all = w->warp[c].sample, *s = all + SAMPLE_SIZE * at;
    const float half = 0.5f, h = (float)w->k->parts[c].near.spacing;
    corner[0] = s[SAMPLE_F] * s[SAMPLE_S] + s[SAMPLE_R];
    for (size_t a = 0; a < 3; a++) {
        const size_t above = at + stride[a], below = at - stride[a];
        const float *up = all + SAMPLE_SIZE * above, *down = all + SAMPLE_SIZE * below;
        float change = 0;
        for (size_t i = 0; i < 3; i++)
            change += s[SAMPLE_G + i] * (p[4 * above + i] - p[4 * below + i]);
        corner[1 + a] =
            half * (h * s[SAMPLE_S] * change + (s[SAMPLE_F] * (up[SAMPLE_S] - down[SAMPLE_S]) +
                                                (up[SAMPLE_R] - down[SAMPLE_R])));
    }
}

static void warped_corners(template_work *w, size_t c, float *corner)
{
    const size_t *n = w->k->stations, stride[3] = {1, n[0], n[0] * n[1]};
    for (size_t row = 0; row < n[1] * n[2]; row++) sample_row(w, c, row * n[0], n[0]);
    for (size_t z = 0; z <= w->blocks[2]; z++)
        for (size_t y = 0; y <= w->blocks[1]; y++)
            for (size_t x = 0; x <= w->blocks[0]; x++, corner += 4) {
                const size_t at = 1 + x + stride[1] * (1 + y) + stride[2] * (1 + z);
                const float *u = w->warp[c].points + 4 * at;
                warped_corner(w, c, at, stride, corner);
                if (!is_in(&w->k->far[c], u)) corner[0] = NAN;
            }
}

void sdm_template_corners(template_work *w, size_t c)
{
    const size_t line = w->blocks[0] + 1, rows = w->blocks[1] + 1, planes = w->blocks[2] + 1,
                 first = c * line * rows * planes;
    float *corner = w->corner + 4 * first;
    if (w->part[c].warped)
        warped_corners(w, c, corner);
    else if (w->part[c].rigid)
        rigid_corners(w, c, corner);
}
