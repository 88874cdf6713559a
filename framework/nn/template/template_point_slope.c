/* Derivatives of the distance to a part at a point, by where the point lies in the template and by
   the metric. */
#include <math.h>
#include <string.h>

#include "template_derivative.h"

typedef float quad __attribute__((vector_size(16)));

static quad quad_at(const float *p)
{
    quad q;
    memcpy(&q, p, sizeof q);
    return q;
}

/* A trilinear cell: the lower node along each axis, the fraction of the way to the next one, and
   how fast the fraction changes with the index in `near` (0 where the index is clamped). */
typedef struct cell {
    ptrdiff_t node[3];
    float t[3], rate;
    bool moves[3];
} cell;

static cell cell_of(const float u[3], float scale, const float offset[3], const int32_t n[3])
{
    cell c = {.rate = scale};
    for (int a = 0; a < 3; a++) {
        const float x = u[a] * scale + offset[a], last = (float)(n[a] - 1);
        const float y = x > 0 ? x < last ? x : last : 0;
        ptrdiff_t i = (ptrdiff_t)y;
        if (i > n[a] - 2) i = n[a] - 2;
        c.node[a] = i;
        c.t[a] = y - (float)i;
        c.moves[a] = x > 0 && x < last;
    }
    return c;
}

/* The template at a point: distance f, gradient g, and their derivatives by the index u. */
typedef struct template_slope {
    float f, g[3], df[3], dg[3][3]; /* dg[a]: derivative of g by u[a] */
} template_slope;

static template_slope template_at(const template_level *l, const float u[3])
{
    const cell c = cell_of(u, l->scale, l->offset, l->n);
    const ptrdiff_t line = 4 * (ptrdiff_t)l->n[0], plane = line * l->n[1];
    const float *at = l->nodes + 4 * c.node[0] + line * c.node[1] + plane * c.node[2];
    // sums over the corners: no derivative, by x, y, z, and the mixed ones yz, xz, xy
    quad column[4], column_z[4];
    for (int i = 0; i < 4; i++) {
        const float *p = at + (i & 1 ? 4 : 0) + (i & 2 ? line : 0);
        column_z[i] = quad_at(p + plane) - quad_at(p);
        column[i] = quad_at(p) + c.t[2] * column_z[i];
    }
    const quad y0 = column[2] - column[0], y1 = column[3] - column[1];
    const quad yz0 = column_z[2] - column_z[0], yz1 = column_z[3] - column_z[1];
    const quad r0 = column[0] + c.t[1] * y0, r1 = column[1] + c.t[1] * y1;
    const quad z0 = column_z[0] + c.t[1] * yz0, z1 = column_z[1] + c.t[1] * yz1;
    const quad qx = r1 - r0, qxy = y1 - y0, qxz = z1 - z0;
    const quad q = r0 + c.t[0] * qx, qy = y0 + c.t[0] * qxy, qz = z0 + c.t[0] * qxz,
               qyz = yz0 + c.t[0] * (yz1 - yz0);
    float bend[3], slope[3];
    for (int a = 0; a < 3; a++) bend[a] = c.t[a] * (1 - c.t[a]), slope[a] = 1 - 2 * c.t[a];
    template_slope s = {.f = q[0] - l->half * (bend[0] * qx[1] + bend[1] * qy[2] + bend[2] * qz[3]),
                        .g = {q[1], q[2], q[3]}};
    const float df[3] = {qx[0] - l->half * (slope[0] * qx[1] + bend[1] * qxy[2] + bend[2] * qxz[3]),
                         qy[0] - l->half * (bend[0] * qxy[1] + slope[1] * qy[2] + bend[2] * qyz[3]),
                         qz[0] -
                             l->half * (bend[0] * qxz[1] + bend[1] * qyz[2] + slope[2] * qz[3])};
    const quad by[3] = {qx, qy, qz};
    for (int a = 0; a < 3; a++) {
        const float rate = c.moves[a] ? c.rate : 0;
        s.df[a] = rate * df[a];
        for (int b = 0; b < 3; b++) s.dg[a][b] = rate * by[a][b + 1];
    }
    return s;
}

// du[3] = derivative of the correction by the index u
static void correction_slope(const template_correction *k, const float u[3], float du[3])
{
    const cell c = cell_of(u, k->scale, k->offset, k->n);
    const ptrdiff_t line = k->n[0], plane = line * k->n[1];
    const float *at = k->map + c.node[0] + line * c.node[1] + plane * c.node[2];
    float low[3] = {0};
    for (int i = 0; i < 8; i++) {
        const int bit[3] = {i & 1, i >> 1 & 1, i >> 2};
        const float v = at[bit[0] + (bit[1] ? line : 0) + (bit[2] ? plane : 0)];
        float w[3];
        for (int a = 0; a < 3; a++) w[a] = bit[a] ? c.t[a] : 1 - c.t[a];
        low[0] += (bit[0] ? v : -v) * w[1] * w[2];
        low[1] += (bit[1] ? v : -v) * w[0] * w[2];
        low[2] += (bit[2] ? v : -v) * w[0] * w[1];
    }
    for (int a = 0; a < 3; a++) du[a] = c.moves[a] ? c.rate * low[a] : 0;
}

void sdm_template_point_slope(const template_work *w, size_t c, const float u[3], const float m[6],
                              point_slope *out)
{
    const template_network *k = w->k;
    bool in = true;
    for (int a = 0; a < 3; a++) in &= u[a] >= 0 && u[a] <= (float)(k->near[c].n[a] - 1);
    const template_slope s = template_at(in ? &k->near[c] : &k->far[c], u);
    const float e = 1e-3f, *g = s.g;
    // factor = sqrt(d / n), d = g^T g + e, n = g^T G g + e t
    const float gg[3] = {m[0] * g[0] + m[5] * g[1] + m[4] * g[2],
                         m[5] * g[0] + m[1] * g[1] + m[3] * g[2],
                         m[4] * g[0] + m[3] * g[1] + m[2] * g[2]};
    const float d = g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + e,
                n = g[0] * gg[0] + g[1] * gg[1] + g[2] * gg[2] + e * (m[0] + m[1] + m[2]) / 3;
    *out = (point_slope){.u = {u[0], u[1], u[2]}, .f = s.f, .factor = sqrtf(d / n)};
    memcpy(out->g, s.g, sizeof out->g);
    memcpy(out->df, s.df, sizeof out->df);
    memcpy(out->dg, s.dg, sizeof out->dg);
    for (int a = 0; a < 3; a++) {
        const float *dg = s.dg[a];
        const float by_d = g[0] * dg[0] + g[1] * dg[1] + g[2] * dg[2],
                    by_n = gg[0] * dg[0] + gg[1] * dg[1] + gg[2] * dg[2];
        out->by_u[a] = out->factor * (by_d / d - by_n / n);
    }
    const float h = -0.5f * out->factor / n;
    for (int a = 0; a < 3; a++) out->by_metric[a] = h * (g[a] * g[a] + e / 3);
    out->by_metric[3] = 2 * h * g[1] * g[2];
    out->by_metric[4] = 2 * h * g[0] * g[2];
    out->by_metric[5] = 2 * h * g[0] * g[1];
    if (w->correction && c == 0) correction_slope(&w->correction_at, u, out->dr);
}
