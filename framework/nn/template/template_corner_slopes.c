/* Derivatives of the distances at the corners of the blocks, for parts with a warp, in forward and
   in reverse mode: the derivatives of the formulas in template_corners.c. */
#include <string.h>

#include "template_derivative.h"

// Sets the points of w->row to n stations of part c.
static void load_stations(const template_work *w, size_t c, size_t first, size_t n)
{
    const sdm_lattice *near = &w->k->parts[c].near;
    const warp_scratch *warp = &w->warp[c];
    const template_row *r = &w->row;
    for (size_t x = 0; x < n; x++) {
        const template_station *s = &warp->station[first + x];
        for (int a = 0; a < 3; a++)
            r->u[a][x] = (float)((s->y[a] - near->origin[a]) / near->spacing);
        for (size_t a = 0; a < 6; a++) r->metric[a][x] = warp->metric[8 * (first + x) + a];
    }
}

// The element x of rows.
static point_slope slope_at(const template_row *points, const template_slope_rows *r, size_t x)
{
    point_slope out = {.f = r->f[x], .factor = r->factor[x]};
    for (int a = 0; a < 3; a++) {
        out.u[a] = points->u[a][x];
        out.g[a] = r->g[a][x];
        out.df[a] = r->df[a][x];
        out.by_u[a] = r->by_u[a][x];
        out.dr[a] = r->dr[a][x];
        for (int b = 0; b < 3; b++) out.dg[a][b] = r->dg[a][b][x];
    }
    for (int a = 0; a < 6; a++) out.by_metric[a] = r->by_metric[a][x];
    return out;
}

void sdm_template_station_slopes(const template_work *w, size_t c, template_slope_rows *rows,
                                 template_slope_rows *far, point_slope *at)
{
    const size_t *n = w->k->stations;
    for (size_t row = 0; row < n[1] * n[2]; row++) {
        load_stations(w, c, row * n[0], n[0]);
        sdm_template_slope_rows(w, c, n[0], rows, far);
        for (size_t x = 0; x < n[0]; x++) at[row * n[0] + x] = slope_at(&w->row, rows, x);
    }
}

// out[8] = the derivative of a sample, without the change of the correction at a fixed point.
static void sample_slope(const point_slope *p, const float du[3], const float metric[6], float *out)
{
    for (int e = 0; e < SAMPLE_SIZE; e++) out[e] = 0;
    for (int a = 0; a < 3; a++) {
        out[SAMPLE_F] += p->df[a] * du[a];
        out[SAMPLE_S] += p->by_u[a] * du[a];
        out[SAMPLE_R] += p->dr[a] * du[a];
        for (int i = 0; i < 3; i++) out[SAMPLE_G + i] += p->dg[a][i] * du[a];
    }
    for (int a = 0; a < 6; a++) out[SAMPLE_S] += p->by_metric[a] * metric[a];
}

// The samples of a row of n stations.
static void row_slopes(const template_work *w, const point_slope *at, const station_motion *m,
                       size_t first, size_t n, float *sample)
{
    const template_row *r = &w->row;
    for (size_t x = 0; x < n; x++) {
        const size_t i = first + x;
        sample_slope(&at[i], m->points + 4 * i, m->metric + 8 * i, sample + SAMPLE_SIZE * i);
        for (int a = 0; a < 3; a++) r->u[a][x] = at[i].u[a];
        r->value[x] = sample[SAMPLE_SIZE * i + SAMPLE_R];
    }
    if (!m->change.map) return;
    sdm_template_kernels()->correct(&m->change, n, (const float *const *)r->u, r->value);
    for (size_t x = 0; x < n; x++) sample[SAMPLE_SIZE * (first + x) + SAMPLE_R] = r->value[x];
}

// The derivative of the corner at a station; stride[a]: stations between neighbours along axis a.
static void corner_slope(const template_work *w, size_t c, const point_slope *at,
                         const station_motion *m, const float *sample, size_t i,
                         const size_t stride[3], float corner[4])
{
    const template_samples *all = &w->warp[c].sample;
    const float *ds = sample + SAMPLE_SIZE * i;
    const float half = 0.5f, h = (float)w->k->parts[c].near.spacing, f = all->f[i], s = all->s[i];
    corner[0] = ds[SAMPLE_F] * s + f * ds[SAMPLE_S] + ds[SAMPLE_R];
    for (size_t a = 0; a < 3; a++) {
        const size_t above = i + stride[a], below = i - stride[a];
        const float *dup = sample + SAMPLE_SIZE * above, *ddown = sample + SAMPLE_SIZE * below;
        float change = 0, dchange = 0;
        for (size_t e = 0; e < 3; e++) {
            const float du = at[above].u[e] - at[below].u[e];
            change += all->g[e][i] * du;
            dchange += ds[SAMPLE_G + e] * du +
                       all->g[e][i] * (m->points[4 * above + e] - m->points[4 * below + e]);
        }
        corner[1 + a] =
            half * (h * (ds[SAMPLE_S] * change + s * dchange) +
                    ds[SAMPLE_F] * (all->s[above] - all->s[below]) +
                    f * (dup[SAMPLE_S] - ddown[SAMPLE_S]) + (dup[SAMPLE_R] - ddown[SAMPLE_R]));
    }
}

void sdm_template_corner_slopes(const template_work *w, size_t c, const point_slope *at,
                                const station_motion *m, float *sample, float *corner)
{
    const size_t *n = w->k->stations, stride[3] = {1, n[0], n[0] * n[1]};
    for (size_t row = 0; row < n[1] * n[2]; row++) row_slopes(w, at, m, row * n[0], n[0], sample);
    for (size_t z = 0; z <= w->blocks[2]; z++)
        for (size_t y = 0; y <= w->blocks[1]; y++)
            for (size_t x = 0; x <= w->blocks[0]; x++, corner += 4)
                corner_slope(w, c, at, m, sample, 1 + x + stride[1] * (1 + y) + stride[2] * (1 + z),
                             stride, corner);
}

/* Reverse mode. */

// The transpose of corner_slope(): adds to the samples and points[stations][4].
static void corner_back(const template_work *w, size_t c, const point_slope *at,
                        const float *corner, size_t i, const size_t stride[3], float *sample,
                        float *points)
{
    const template_samples *all = &w->warp[c].sample;
    float *to = sample + SAMPLE_SIZE * i;
    const float half = 0.5f, h = (float)w->k->parts[c].near.spacing, f = all->f[i], s = all->s[i];
    to[SAMPLE_F] += corner[0] * s;
    to[SAMPLE_S] += corner[0] * f;
    to[SAMPLE_R] += corner[0];
    for (size_t a = 0; a < 3; a++) {
        const size_t above = i + stride[a], below = i - stride[a];
        float *up = sample + SAMPLE_SIZE * above, *down = sample + SAMPLE_SIZE * below;
        const float slope = half * corner[1 + a], by_change = slope * h * s;
        float change = 0;
        for (size_t e = 0; e < 3; e++) {
            const float du = at[above].u[e] - at[below].u[e], moved = by_change * all->g[e][i];
            change += all->g[e][i] * du;
            to[SAMPLE_G + e] += by_change * du;
            points[4 * above + e] += moved;
            points[4 * below + e] -= moved;
        }
        to[SAMPLE_S] += slope * h * change;
        to[SAMPLE_F] += slope * (all->s[above] - all->s[below]);
        up[SAMPLE_S] += slope * f;
        down[SAMPLE_S] -= slope * f;
        up[SAMPLE_R] += slope;
        down[SAMPLE_R] -= slope;
    }
}

// The transpose of sample_slope(): adds to u[3] and metric[6].
static void sample_back(const point_slope *p, const float *sample, float u[3], float metric[6])
{
    for (int a = 0; a < 3; a++) {
        u[a] += sample[SAMPLE_F] * p->df[a] + sample[SAMPLE_S] * p->by_u[a] +
                sample[SAMPLE_R] * p->dr[a];
        for (int i = 0; i < 3; i++) u[a] += sample[SAMPLE_G + i] * p->dg[a][i];
    }
    for (int a = 0; a < 6; a++) metric[a] += sample[SAMPLE_S] * p->by_metric[a];
}

// The transpose of row_slopes().
static void row_back(const template_work *w, const point_slope *at, const float *sample,
                     size_t first, size_t n, const station_adjoint *adjoint)
{
    const template_row *r = &w->row;
    for (size_t x = 0; x < n; x++) {
        const size_t i = first + x;
        const float *from = sample + SAMPLE_SIZE * i;
        sample_back(&at[i], from, adjoint->points + 4 * i, adjoint->metric + 8 * i);
        for (int a = 0; a < 3; a++) r->u[a][x] = at[i].u[a];
        r->value[x] = from[SAMPLE_R];
    }
    if (adjoint->change)
        sdm_template_kernels()->correct_back(&w->correction_at, n, (const float *const *)r->u,
                                             r->value, adjoint->change);
}

void sdm_template_corner_slopes_back(const template_work *w, size_t c, const point_slope *at,
                                     const float *corner, float *sample,
                                     const station_adjoint *adjoint)
{
    const size_t *n = w->k->stations, stride[3] = {1, n[0], n[0] * n[1]};
    memset(sample, 0, SAMPLE_SIZE * stride[2] * n[2] * sizeof *sample);
    for (size_t z = 0; z <= w->blocks[2]; z++)
        for (size_t y = 0; y <= w->blocks[1]; y++)
            for (size_t x = 0; x <= w->blocks[0]; x++, corner += 4)
                corner_back(w, c, at, corner, 1 + x + stride[1] * (1 + y) + stride[2] * (1 + z),
                            stride, sample, adjoint->points);
    for (size_t row = 0; row < n[1] * n[2]; row++)
        row_back(w, at, sample, row * n[0], n[0], adjoint);
}
