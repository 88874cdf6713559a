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

// The samples of the stations first .. first + n - 1, a row; afterwards those of the next row, of
// which the kernels overwrite some.
static void sample_row(template_work *w, size_t c, size_t first, size_t n)
{
    const float *points = w->warp[c].points + 4 * first, *metric = w->warp[c].metric + 8 * first;
    const template_samples *s = &w->warp[c].sample;
    const template_table *t = w->kernels;
    const template_row row = w->row;
    // the lookup reads and writes the arrays of the samples
    w->row.f = s->f + first;
    for (size_t a = 0; a < 3; a++) w->row.u[a] = s->u[a] + first, w->row.g[a] = s->g[a] + first;
    const template_row *r = &w->row;
    t->separate(n, points, 4, (float *const[]){r->u[0], r->u[1], r->u[2], r->far_f});
    t->separate(n, metric, 8, r->metric);
    t->separate(n, metric + 4, 8,
                (float *const[]){r->metric[4], r->metric[5], r->far_f, r->far_g[0]});
    sdm_template_lookup(w, c, n);
    for (size_t x = 0; x < n; x++) r->value[x] = 1, s->r[first + x] = 0;
    t->normalise(n, r->value, (const float *const *)r->g, (const float *const *)r->metric,
                 s->s + first);
    if (w->correction_at.map && c == 0)
        t->correct(&w->correction_at, n, (const float *const *)r->u, s->r + first);
    w->row = row;
}

// Sets the distance at n corners from station `first` on to NAN outside of the lattice `far`.
static void forget_stations(const template_work *w, size_t c, size_t first, size_t n, float *corner)
{
    float *const *u = w->warp[c].sample.u;
    for (size_t x = 0, at = first; x < n; x++, at++)
        if (!is_in(&w->k->far[c], (const float[]){u[0][at], u[1][at], u[2][at]}))
            corner[4 * x] = NAN;
}

static void warped_corners(template_work *w, size_t c, float *corner)
{
    const size_t *n = w->k->stations, stride[3] = {1, n[0], n[0] * n[1]}, line = w->blocks[0] + 1;
    const float spacing = (float)w->k->parts[c].near.spacing;
    for (size_t row = 0; row < n[1] * n[2]; row++) sample_row(w, c, row * n[0], n[0]);
    for (size_t z = 0; z <= w->blocks[2]; z++)
        for (size_t y = 0; y <= w->blocks[1]; y++, corner += 4 * line) {
            const size_t first = 1 + stride[1] * (1 + y) + stride[2] * (1 + z);
            w->kernels->corners(&w->warp[c].sample, first, line, stride, spacing, corner);
            forget_stations(w, c, first, line, corner);
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
