/* Tree of boundary edges, and the solid angles of the strips that close an open mesh; terms:
 * boundary.h. */
#include "boundary.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "exactly/predicates.h"
#include "sdm/internal/vec3.h"
#include "sdm/memory.h"

static const double pi = 3.14159265358979323846;

/* A boundary edge, in the direction in which more of its triangles use it. weight: the difference
 * between the numbers of triangles in the two directions. */
typedef struct directed_edge {
    uint32_t from, to, weight, used;
} directed_edge;

static int directed_compare(const void *a, const void *b)
{
    const directed_edge *x = a, *y = b;
    if (x->from != y->from) return x->from < y->from ? -1 : 1;
    return x->to < y->to ? -1 : x->to > y->to;
}

/* Index of the first unused edge that starts at `vert` and has the given weight, or SDM_NONE. e[n]:
 * sorted by start. */
static uint32_t directed_next(const directed_edge *e, size_t n, uint32_t vert, uint32_t weight)
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

/* Fills node `at` for the edges e[order[0 .. n - 1]], and recursively the nodes below it. */
static void chain_build(const sdm_mesh *m, const directed_edge *e, const uint32_t *order,
                        uint32_t n, sdm_chain *at)
{
    // the chord
    const directed_edge *first = &e[order[0]], *last = &e[order[n - 1]];
    at->n = n;
    at->vert[0] = first->from;
    at->vert[1] = last->to;
    for (size_t k = 0; k < 2; k++)
        memcpy(at->end[k], &m->vert[3 * (size_t)at->vert[k]], sizeof at->end[k]);
    at->weight = first->weight;
    // length, fan and bounding box of the edges; weight 0 if they are not consecutive
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
    // bounding sphere, then the two halves
    for (int a = 0; a < 3; a++) at->centre[a] = lo[a] + 0.5 * (hi[a] - lo[a]);
    at->radius = 0.5 * sqrt(v3_dist2(lo, hi));
    if (n == 1) return;
    chain_build(m, e, order, n / 2, at + 1);
    chain_build(m, e, order + n / 2, n - n / 2, at + 2 * (size_t)(n / 2));
}

sdm_status sdm_boundary_build(const sdm_mesh *m, const sdm_topology *topo, sdm_boundary *b,
                              sdm_error *err)
{
    size_t n = 0, done = 0;
    // boundary edges: not used equally often in both directions
    for (size_t i = 0; i < topo->n_edges; i++) n += topo->edges[i].n_up != topo->edges[i].n_down;
    b->n = n;
    if (!n) return SDM_OK;
    directed_edge *e = NULL;
    uint32_t *order = NULL;
    sdm_status s = SDM_ALLOC(&b->chain, 2 * n - 1, "boundary edges", err);
    if (!s) s = SDM_ALLOC(&e, n, "boundary edges", err);
    if (!s) s = SDM_ALLOC(&order, n, "boundary edges", err);
    // give each edge the direction in which more of its triangles use it
    for (size_t i = 0, k = 0; !s && i < topo->n_edges; i++) {
        const sdm_edge *x = &topo->edges[i];
        if (x->n_up > x->n_down) e[k++] = (directed_edge){x->lo, x->hi, x->n_up - x->n_down, 0};
        if (x->n_up < x->n_down) e[k++] = (directed_edge){x->hi, x->lo, x->n_down - x->n_up, 0};
    }
    if (!s) {
        // order them into loops, then build the tree
        qsort(e, n, sizeof *e, directed_compare);
        for (size_t i = 0; i < n; i++) {
            for (uint32_t k = e[i].used ? SDM_NONE : (uint32_t)i; k != SDM_NONE;
                 k = directed_next(e, n, e[k].to, e[k].weight)) {
                e[k].used = 1;
                order[done++] = k;
            }
        }
        chain_build(m, e, order, (uint32_t)n, b->chain);
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

/* Half the solid angle of the strip of a chord, seen from x, as the vector out = (sine, cosine) of
 * any length: Van Oosterom and Strackee 1983 with the third corner at infinity. end[2]: ends of the
 * chord minus x, far[2]: their distances from x, p: see sdm_strips_evaluate(). Returns false when x
 * is an end. */
static bool strip_half_angle(const sdm_strips *s, const sdm_chain *c, const double end[2][3],
                             const double far[2], const double p[2], double out[2])
{
    if (!(far[0] > 0 && far[1] > 0)) return false;
    double u[2][3], along[2], cross[3];
    for (int k = 0; k < 2; k++) {
        // offsets of the ends across d, from the rounded coordinates that decide crossings: near a
        // vertex other coordinates could give another side
        const double *v = &s->across[3 * (size_t)c->vert[k] + 1], y = v[0] - p[0], z = v[1] - p[1];
        const double inverse = 1 / far[k], cosine = v3_dot(end[k], s->d) * inverse;
        // x is moved by an infinitesimal amount along coordinate 1 (simulation of simplicity, as in
        // predicates.h)
        const double shift = y == 0 && z == 0 ? -1e-200 : y;
        for (int i = 0; i < 3; i++) u[k][i] = (shift * s->step[0][i] + z * s->step[1][i]) * inverse;
        v3_along(u[k], -v3_dot(u[k], s->d), s->d, u[k]);
        // 1 + cosine without cancellation
        along[k] = cosine >= 0 ? 1 + cosine : v3_dot(u[k], u[k]) / (1 - cosine);
    }
    v3_cross(u[0], u[1], cross);
    out[0] = v3_dot(s->d, cross);
    out[1] = along[0] * along[1] + v3_dot(u[0], u[1]);
    // x lies almost in the strip, whose solid angle is then half the sphere: take the side that the
    // exact predicate of the crossings gives
    if (out[1] <= 0 && fabs(out[0]) <= 1e-5 * -out[1]) {
        const int side = sdm_side(&s->across[3 * (size_t)c->vert[0] + 1],
                                  &s->across[3 * (size_t)c->vert[1] + 1], p, NULL);
        out[0] = copysign(out[0], (double)(-side * s->orientation));
    }
    return true;
}

/* Squared distance from x to an edge, or a lower bound on it. end, far: as in
 * strip_half_angle(). */
static double edge_distance2(const double end[2][3], const double far[2], double length)
{
    double q[3], e[3];
    // triangle inequality: no point of the edge is nearer than r
    const double r = 0.5 * (far[0] + far[1] - length);
    if (r > 4 * length) return r * r;
    v3_sub(end[1], end[0], e);
    const double along = -v3_dot(end[0], e), length2 = v3_dot(e, e);
    v3_along(end[0], !(along > 0) ? 0 : along < length2 ? along / length2 : 1, e, q);
    return v3_dot(q, q);
}

/* May the chain be replaced by its chord? r: centre of its bounding sphere minus x; gap: distance
 * from x to the sphere. Conditions: the solid angle of the fan is small, and the line through x
 * along d misses the sphere, so the strips of edges and chord cannot differ by a full turn. */
static bool chain_is_far(const sdm_chain *c, const double r[3], const double d[3], double gap,
                         double tolerance)
{
    if (!(c->weight > 0 && gap > 0 && c->fan * c->weight <= 4 * pi * gap * gap * tolerance))
        return false;
    double off[3];
    v3_along(r, -v3_dot(r, d), d, off);
    return v3_dot(off, off) > c->radius * c->radius * (1 + 1e-9);
}

/* Sum of angles: angles are added by multiplying complex numbers re + i im, which needs atan2()
 * only when the sum leaves a half turn. */
typedef struct angle_sum {
    double total, re, im;
} angle_sum;

static void angle_add(angle_sum *s, const double z[2], double weight)
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

sdm_strips_winding sdm_strips_evaluate(const sdm_strips *s, const double x[3], const double p[2],
                                       double tolerance)
{
    sdm_strips_winding out = {.distance = INFINITY};
    angle_sum sum = {0, 1, 0};
    double nearest2 = INFINITY;
    const sdm_chain *c = s->boundary->chain, *end = s->boundary->n ? c + 2 * s->boundary->n - 1 : c;
    while (c < end) {
        double ends[2][3], r[3], z[2], r2 = 0;
        if (c->n > 1) {
            // several edges: descend unless the chord is accurate enough
            v3_sub(c->centre, x, r);
            const double gap = v3_norm(r) - c->radius;
            if (!chain_is_far(c, r, s->d, gap, tolerance)) {
                c++; // go on with the first child
                continue;
            }
            r2 = gap * gap;
            out.error += c->weight * c->fan / (4 * pi * r2);
        }
        // distance, bound on the gradient, half the solid angle
        v3_sub(c->end[0], x, ends[0]);
        v3_sub(c->end[1], x, ends[1]);
        const double far[2] = {v3_norm(ends[0]), v3_norm(ends[1])};
        if (c->n == 1) r2 = edge_distance2((const double(*)[3])ends, far, c->length);
        out.steepness += c->weight * (c->length * c->length < 4 * r2 || c->n > 1 ? c->length / r2
                                                                                 : 2 / sqrt(r2));
        if (r2 < nearest2) nearest2 = r2;
        if (strip_half_angle(s, c, (const double(*)[3])ends, far, p, z))
            angle_add(&sum, z, c->weight);
        c += 2 * (size_t)c->n - 1; // skip all nodes below c
    }
    out.winding = (sum.total + atan2(sum.im, sum.re)) / (2 * pi);
    out.distance = sqrt(nearest2);
    return out;
}

double sdm_strips_reach(const sdm_strips_winding *s, double change)
{
    // at distance t < s->distance the bound on the gradient is at most steepness * (distance /
    // (distance - t))^2; its integral from 0 to t is steepness * t * distance / (distance - t)
    if (!(s->distance > 0)) return 0;
    if (!(s->steepness > 0)) return INFINITY;
    const double reach = 4 * pi * change / s->steepness;
    return isinf(s->distance) ? reach : reach * s->distance / (s->distance + reach);
}
