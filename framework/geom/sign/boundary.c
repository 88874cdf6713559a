/* Boundary edges and the solid angles of the strips that close them. */
#include "boundary.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "exactly/predicates.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

static const double pi = 3.14159265358979323846;

/* A boundary edge in the direction of its triangles. */
typedef struct directed {
    uint32_t from, to, weight, used;
} directed;

static int by_begin(const void *a, const void *b)
{
    const directed *x = a, *y = b;
    if (x->from != y->from) return x->from < y->from ? -1 : 1;
    return x->to < y->to ? -1 : x->to > y->to;
}

/* First unused edge from `vert` with the given weight; SDM_NONE without one. */
static uint32_t follow(const directed *e, size_t n, uint32_t vert, uint32_t weight)
{
    size_t low = 0, high = n;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        if (e[middle].from < vert)
            low = middle + 1;
        else
            high = middle;
    }
    for (; low < n && e[low].from == vert; low++)
        if (!e[low].used && e[low].weight == weight) return (uint32_t)low;
    return SDM_NONE;
}

/* Chain `at` of edges order[0 .. n - 1] and the chains below it. */
static void build_chain(const sdm_mesh *m, const directed *e, const uint32_t *order, uint32_t n,
                        sdm_chain *at)
{
    const directed *first = &e[order[0]], *last = &e[order[n - 1]];
    at->n = n;
    at->vert[0] = first->from;
    at->vert[1] = last->to;
    for (size_t k = 0; k < 2; k++)
        memcpy(at->end[k], &m->vert[3 * (size_t)at->vert[k]], sizeof at->end[k]);
    at->weight = first->weight;
    double lo[3], hi[3];
    for (int a = 0; a < 3; a++) {
        lo[a] = fmin(at->end[0][a], at->end[1][a]);
        hi[a] = fmax(at->end[0][a], at->end[1][a]);
    }
    for (uint32_t i = 0; i < n; i++) {
        const double *u = &m->vert[3 * (size_t)e[order[i]].from],
                     *v = &m->vert[3 * (size_t)e[order[i]].to];
        double r[3], q[3], cross[3];
        if (i && (e[order[i]].from != e[order[i - 1]].to || e[order[i]].weight != first->weight))
            at->weight = 0;
        v3_sub(u, at->end[0], r);
        v3_sub(v, at->end[0], q);
        v3_cross(r, q, cross);
        at->fan += 0.5 * v3_norm(cross);
        at->length += sqrt(v3_dist2(u, v));
        for (int a = 0; a < 3; a++) {
            lo[a] = fmin(lo[a], fmin(u[a], v[a]));
            hi[a] = fmax(hi[a], fmax(u[a], v[a]));
        }
    }
    for (int a = 0; a < 3; a++) at->middle[a] = lo[a] + 0.5 * (hi[a] - lo[a]);
    at->radius = 0.5 * sqrt(v3_dist2(lo, hi));
    if (n == 1) return;
    build_chain(m, e, order, n / 2, at + 1);
    build_chain(m, e, order + n / 2, n - n / 2, at + 2 * (size_t)(n / 2));
}

sdm_status sdm_boundary_build(const sdm_mesh *m, const sdm_topology *topo, sdm_boundary *b,
                              sdm_error *err)
{
    size_t n = 0, done = 0;
    for (size_t i = 0; i < topo->n_edges; i++) n += topo->edges[i].n_up != topo->edges[i].n_down;
    b->n = n;
    if (!n) return SDM_OK;
    directed *e = NULL;
    uint32_t *order = NULL;
    sdm_status s = SDM_ALLOC(&b->chain, 2 * n - 1, "boundary edges", err);
    if (!s) s = SDM_ALLOC(&e, n, "boundary edges", err);
    if (!s) s = SDM_ALLOC(&order, n, "boundary edges", err);
    for (size_t i = 0, k = 0; !s && i < topo->n_edges; i++) {
        const sdm_edge *x = &topo->edges[i];
        if (x->n_up > x->n_down) e[k++] = (directed){x->lo, x->hi, x->n_up - x->n_down, 0};
        if (x->n_up < x->n_down) e[k++] = (directed){x->hi, x->lo, x->n_down - x->n_up, 0};
    }
    if (!s) {
        qsort(e, n, sizeof *e, by_begin);
        for (size_t i = 0; i < n; i++) {
            for (uint32_t k = e[i].used ? SDM_NONE : (uint32_t)i; k != SDM_NONE;
                 k = follow(e, n, e[k].to, e[k].weight)) {
                e[k].used = 1;
                order[done++] = k;
            }
        }
        build_chain(m, e, order, (uint32_t)n, b->chain);
    }
    sdm_free(e);
    sdm_free(order);
    return s;
}

void sdm_boundary_dispose(sdm_boundary *b)
{
    sdm_free(b->chain);
    *b = (sdm_boundary){0};
}

/* The strip of a chord seen from x as sine and cosine of half its solid angle, not normalised (Van
   Oosterom and Strackee 1983 with the third corner at infinity); end: its ends seen from x at the
   distances `far`. false: x is an end. */
static bool strip(const sdm_strips *s, const sdm_chain *c, const double end[2][3],
                  const double far[2], const double p[2], double out[2])
{
    if (!(far[0] > 0 && far[1] > 0)) return false;
    double u[2][3], along[2], cross[3];
    for (int k = 0; k < 2; k++) {
        // across d from the rounded coordinates of the crossings: near a vertex only they tell its
        // side
        const double *v = &s->across[3 * (size_t)c->vert[k] + 1], y = v[0] - p[0], z = v[1] - p[1];
        const double inverse = 1 / far[k], cosine = v3_dot(end[k], s->d) * inverse;
        // x is moved by an infinitely small amount along coordinate 1, as by the predicates
        const double shift = y == 0 && z == 0 ? -1e-200 : y;
        for (int i = 0; i < 3; i++) u[k][i] = (shift * s->step[0][i] + z * s->step[1][i]) * inverse;
        v3_along(u[k], -v3_dot(u[k], s->d), s->d, u[k]);
        // 1 + cosine without cancellation
        along[k] = cosine >= 0 ? 1 + cosine : v3_dot(u[k], u[k]) / (1 - cosine);
    }
    v3_cross(u[0], u[1], cross);
    out[0] = v3_dot(s->d, cross);
    out[1] = along[0] * along[1] + v3_dot(u[0], u[1]);
    // hardly beside the strip, which fills half the sphere: the side must be that of the crossings
    if (out[1] <= 0 && fabs(out[0]) <= 1e-5 * -out[1]) {
        const int side = sdm_side(&s->across[3 * (size_t)c->vert[0] + 1],
                                  &s->across[3 * (size_t)c->vert[1] + 1], p, NULL);
        out[0] = copysign(out[0], (double)(-side * s->orientation));
    }
    return true;
}

/* Squared distance of an edge seen from x, or a little less. */
static double distance2(const double end[2][3], const double far[2], double length)
{
    double q[3], e[3];
    const double r = 0.5 * (far[0] + far[1] - length); // no point of the edge is nearer
    if (r > 4 * length) return r * r;
    v3_sub(end[1], end[0], e);
    const double along = -v3_dot(end[0], e), length2 = v3_dot(e, e);
    v3_along(end[0], !(along > 0) ? 0 : along < length2 ? along / length2 : 1, e, q);
    return v3_dot(q, q);
}

/* Is the chain far enough to be taken as its chord? The fan is then seen under a small angle, and
   the line through x along d does not meet it, so that no strip of an edge and of the chord differ
   by a whole turn. */
static bool is_far(const sdm_chain *c, const double r[3], const double d[3], double gap,
                   double tolerance)
{
    if (!(c->weight > 0 && gap > 0 && c->fan * c->weight <= 4 * pi * gap * gap * tolerance))
        return false;
    double off[3];
    v3_along(r, -v3_dot(r, d), d, off);
    return v3_dot(off, off) > c->radius * c->radius * (1 + 1e-9);
}

/* Angles add up as complex numbers multiply, while the sum stays within a half turn. */
typedef struct angle_sum {
    double total, re, im;
} angle_sum;

static void add_angle(angle_sum *s, const double z[2], double weight)
{
    if (weight != 1 || z[1] <= 0) {
        s->total += weight * atan2(z[0], z[1]);
        return;
    }
    const double re = s->re * z[1] - s->im * z[0];
    s->im = s->re * z[0] + s->im * z[1];
    s->re = re;
    if (re > 1e-60 && re < 1e60 && fabs(s->im) < 1e60) return;
    s->total += atan2(s->im, re);
    s->re = 1;
    s->im = 0;
}

sdm_strips_share sdm_strips_find(const sdm_strips *s, const double x[3], const double p[2],
                                 double tolerance)
{
    sdm_strips_share out = {.distance = INFINITY};
    angle_sum sum = {0, 1, 0};
    double nearest2 = INFINITY;
    const sdm_chain *c = s->boundary->chain,
                    *end = c + (s->boundary->n ? 2 * s->boundary->n - 1 : 0);
    while (c < end) {
        double ends[2][3], r[3], z[2], r2 = 0;
        if (c->n > 1) {
            v3_sub(c->middle, x, r);
            const double gap = v3_norm(r) - c->radius;
            if (!is_far(c, r, s->d, gap, tolerance)) {
                c++; // to the first half
                continue;
            }
            r2 = gap * gap;
            out.error += c->weight * c->fan / (4 * pi * r2);
        }
        v3_sub(c->end[0], x, ends[0]);
        v3_sub(c->end[1], x, ends[1]);
        const double far[2] = {v3_norm(ends[0]), v3_norm(ends[1])};
        if (c->n == 1) r2 = distance2((const double(*)[3])ends, far, c->length);
        out.steepness += c->weight * (c->length * c->length < 4 * r2 || c->n > 1 ? c->length / r2
                                                                                 : 2 / sqrt(r2));
        if (r2 < nearest2) nearest2 = r2;
        if (strip(s, c, (const double(*)[3])ends, far, p, z)) add_angle(&sum, z, c->weight);
        c += 2 * (size_t)c->n - 1; // past everything below
    }
    out.share = (sum.total + atan2(sum.im, sum.re)) / (2 * pi);
    out.distance = sqrt(nearest2);
    return out;
}

double sdm_strips_reach(const sdm_strips_share *s, double change)
{
    // within t < distance the bound grows by (distance / (distance - t))^2 at most, its integral is
    // steepness t distance / (distance - t)
    if (!(s->distance > 0)) return 0;
    if (!(s->steepness > 0)) return INFINITY;
    const double reach = 4 * pi * change / s->steepness;
    return isinf(s->distance) ? reach : reach * s->distance / (s->distance + reach);
}
