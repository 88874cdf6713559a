/* Triangle-triangle intersections of a mesh with itself: pairs that share no vertex from the tree,
   those that share one from the vertices; segments by clipping in the triangle's frame. */
#include "contact.h"

#include <float.h>
#include <string.h>

#include "fan.h"
#include "pairs.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

#define KEPT                                                                                       \
    256u // frames of triangles at hand: those that meet others are asked for again and again

typedef struct finder {
    const sdm_mesh *mesh;
    const sdm_topology *topo;
    const sdm_facet *facets;
    sdm_contacts *out;
    sdm_contact *list; // [cap], as they are found
    size_t cap;
    sdm_frame *frame; // [KEPT] of triangles frame_of[KEPT], at the place t % KEPT
    uint32_t *frame_of;
    sdm_budget *budget;
    sdm_error *err;
} finder;

void sdm_frame_flatten(const sdm_frame *f, const double x[3], double xy[2])
{
    double w[3];
    v3_sub(x, f->a, w);
    xy[0] = v3_dot(w, f->u);
    xy[1] = v3_dot(w, f->v);
}

void sdm_frame_lift(const sdm_frame *f, const double xy[2], double x[3])
{
    for (int i = 0; i < 3; i++) x[i] = f->a[i] + xy[0] * f->u[i] + xy[1] * f->v[i];
}

static const double *corner(const finder *w, uint32_t t, int i)
{
    return &w->mesh->vert[3 * (size_t)w->topo->tri[3 * (size_t)t + (size_t)i]];
}

static sdm_status add(finder *w, sdm_contact c)
{
    sdm_contacts *out = w->out;
    // sheets laid on each other many times over: the number of contacts grows with the square of
    // the layers
    const size_t most = 64 * w->topo->n_tri + ((size_t)1 << 20);
    if (out->n == most)
        return sdm_fail(w->err, SDM_E_MESH,
                        "triangles of the mesh touch or cross each other more than %zu times: "
                        "remove its duplicate layers",
                        most);
    if (out->n == w->cap) {
        const size_t cap = w->cap ? 2 * w->cap : 256;
        sdm_status s = sdm_budget_take(w->budget, (cap - w->cap) * sizeof *w->list, w->err);
        if (!s) s = sdm_grow((void **)&w->list, out->n, cap, sizeof *w->list, "contacts", w->err);
        if (s) return s;
        w->cap = cap;
    }
    w->list[out->n++] = c;
    return SDM_OK;
}

static void find_frame(const finder *w, uint32_t t, sdm_frame *f)
{
    sdm_frame *kept = &w->frame[t % KEPT];
    if (w->frame_of[t % KEPT] != t) sdm_facet_frame(w->mesh, t, kept);
    w->frame_of[t % KEPT] = t;
    *f = *kept;
}

/* A triangle of a pair. */
typedef struct side {
    uint32_t tri;
    sdm_frame frame;
    double d[3];  // distances of its corners from the plane of the other; what rounding may explain
                  // is 0
    double moved; // the largest that was made 0
    int mask;     // signs that occur: 1 negative, 2 zero, 4 positive
} side;

/* Fills in the distances of s from the plane of `other`. The doubt of that plane grows with the way
   from its triangle, along the longest edge in its lengths and across in heights. */
static void plane_distances(const finder *w, side *s, const side *other)
{
    const sdm_frame *f = &other->frame;
    const double height = sdm_frame_height(f), per_length = height / (2 * f->half[0]);
    s->mask = 0;
    s->moved = 0;
    for (int k = 0; k < 3; k++) {
        double r[3];
        v3_sub(corner(w, s->tri, k), f->a, r);
        s->d[k] = v3_dot(r, f->n);
        const double reach = fabs(v3_dot(r, f->u)) * per_length + fabs(v3_dot(r, f->v)),
                     size = fabs(s->d[k]);
        if (size * height <= w->out->tolerance * (height + reach)) {
            s->moved = size > s->moved ? size : s->moved;
            s->d[k] = 0;
        }
        s->mask |= s->d[k] < 0 ? 1 : s->d[k] > 0 ? 4 : 2;
    }
}

/* Does triangle j lie on one side of the plane of i, beyond any doubt? Most pairs end here. */
static bool clearly_apart(const finder *w, uint32_t i, uint32_t j)
{
    const sdm_facet *f = &w->facets[i];
    const double *a = corner(w, i, 0), tolerance = 4 * w->out->tolerance;
    int above = 0, below = 0;
    for (int k = 0; k < 3; k++) {
        double r[3];
        v3_sub(corner(w, j, k), a, r);
        const double d = v3_dot(r, f->n) * f->height;
        const double doubt = tolerance * (f->height + fabs(r[0]) + fabs(r[1]) + fabs(r[2]));
        above += d > doubt;
        below += d < -doubt;
    }
    return above == 3 || below == 3;
}

/* The part of the segment p q that lies on the triangle of frame f (made larger by the tolerance);
   false when it is not longer than the tolerance. */
static bool clip_segment(const sdm_frame *f, double tolerance, double p[2], double q[2])
{
    const double hp[3] = {-p[1], f->e1y * p[0] - f->e1x * p[1] - f->kh1,
                          f->e2y * p[0] - f->e2x * p[1]};
    const double hq[3] = {-q[1], f->e1y * q[0] - f->e1x * q[1] - f->kh1,
                          f->e2y * q[0] - f->e2x * q[1]};
    double from = 0, to = 1;
    for (int k = 0; k < 3; k++) {
        const double a = hp[k] - tolerance, b = hq[k] - tolerance;
        if (a > 0 && b > 0) return false;
        if (a > 0) from = fmax(from, a / (a - b));
        if (b > 0) to = fmin(to, a / (a - b));
    }
    const double dx = q[0] - p[0], dy = q[1] - p[1];
    if (!((to - from) * sqrt(dx * dx + dy * dy) > 4 * tolerance)) return false;
    q[0] = p[0] + to * dx;
    q[1] = p[1] + to * dy;
    p[0] += from * dx;
    p[1] += from * dy;
    return true;
}

/* Where triangle s meets the plane of the other: two points; false when it touches in one. */
static bool plane_section(const finder *w, const side *s, double p[2][3])
{
    const double *d = s->d;
    int n = 0;
    for (int k = 0; k < 3 && n < 2; k++)
        if (d[k] == 0) memcpy(p[n++], corner(w, s->tri, k), sizeof p[0]);
    for (int k = 0; k < 3 && n < 2; k++) {
        const int l = (k + 1) % 3;
        if (!((d[k] < 0 && d[l] > 0) || (d[k] > 0 && d[l] < 0))) continue;
        const double *a = corner(w, s->tri, k), *b = corner(w, s->tri, l);
        const double t = d[k] / (d[k] - d[l]);
        for (int c = 0; c < 3; c++) p[n][c] = a[c] + t * (b[c] - a[c]);
        n++;
    }
    return n == 2;
}

/* Adds what `on` has of the segment in which `other` meets its plane. */
static sdm_status add_section(finder *w, const side *on, const side *other, bool *met)
{
    double p[2][3];
    if (!plane_section(w, other, p)) return SDM_OK;
    sdm_contact c = {.tri = on->tri, .other = other->tri, .kind = SDM_CONTACT_TOUCH};
    if (on->mask == 5 && other->mask == 5) c.kind = SDM_CONTACT_CROSSING;
    sdm_frame_flatten(&on->frame, p[0], c.p);
    sdm_frame_flatten(&on->frame, p[1], c.q);
    if (!clip_segment(&on->frame, w->out->tolerance, c.p, c.q)) return SDM_OK;
    *met = true;
    return add(w, c);
}

/* As both have it: the plane of `other` is in doubt all over `on`, so that no other segment is to
 * be had. */
static sdm_status add_only_section(finder *w, const side *on, const side *other, bool *met)
{
    sdm_status s = add_section(w, on, other, met);
    if (s || !*met) return s;
    sdm_contact c = w->list[w->out->n - 1];
    double x[3];
    c.tri = other->tri;
    c.other = on->tri;
    sdm_frame_lift(&on->frame, c.p, x);
    sdm_frame_flatten(&other->frame, x, c.p);
    sdm_frame_lift(&on->frame, c.q, x);
    sdm_frame_flatten(&other->frame, x, c.q);
    return add(w, c);
}

/* True when one of two coplanar triangles covers more than a seam of the other: some edge separates
 * them otherwise. */
static bool covers(const finder *w, const side *a, const side *b)
{
    for (int turn = 0; turn < 2; turn++) {
        const sdm_frame *f = turn ? &b->frame : &a->frame;
        const uint32_t other = turn ? a->tri : b->tri;
        double least[3] = {INFINITY, INFINITY, INFINITY};
        for (int k = 0; k < 3; k++) {
            double x[2];
            sdm_frame_flatten(f, corner(w, other, k), x);
            least[0] = fmin(least[0], -x[1]);
            least[1] = fmin(least[1], f->e1y * x[0] - f->e1x * x[1] - f->kh1);
            least[2] = fmin(least[2], f->e2y * x[0] - f->e2x * x[1]);
        }
        for (int k = 0; k < 3; k++)
            if (!(least[k] < -4 * w->out->tolerance)) return false;
    }
    return true;
}

static sdm_status add_coplanar(finder *w, const side *on, const side *other)
{
    sdm_status s =
        add(w, (sdm_contact){.tri = on->tri, .other = other->tri, .kind = SDM_CONTACT_COPLANAR});
    for (int k = 0; k < 3 && !s; k++) {
        sdm_contact c = {.tri = on->tri, .other = other->tri, .kind = SDM_CONTACT_TOUCH};
        sdm_frame_flatten(&on->frame, corner(w, other->tri, k), c.p);
        sdm_frame_flatten(&on->frame, corner(w, other->tri, (k + 1) % 3), c.q);
        if (clip_segment(&on->frame, w->out->tolerance, c.p, c.q)) s = add(w, c);
    }
    return s;
}

/* Triangles i < j that share so many vertices. */
static sdm_status meet(finder *w, uint32_t i, uint32_t j, int shared)
{
    sdm_contacts *out = w->out;
    side a = {.tri = i}, b = {.tri = j};
    find_frame(w, i, &a.frame);
    find_frame(w, j, &b.frame);
    plane_distances(w, &b, &a);
    if (b.mask == 1 || b.mask == 4) return SDM_OK;
    if (shared && (b.mask == 3 || b.mask == 6)) {
        // the rest of j lies on one side: i and j meet in what they share unless another corner of
        // j is on the plane as well
        if ((b.d[0] == 0) + (b.d[1] == 0) + (b.d[2] == 0) == shared) return SDM_OK;
    }
    plane_distances(w, &a, &b);
    if (a.mask == 1 || a.mask == 4) return SDM_OK;

    sdm_status s = SDM_OK;
    bool met = false;
    if (b.mask == 2 && a.mask == 2) {
        met = covers(w, &a, &b);
        if (met) s = add_coplanar(w, &a, &b);
        if (met && !s) s = add_coplanar(w, &b, &a);
    } else if (shared < 2 && b.mask == 2) {
        s = add_only_section(w, &b, &a, &met);
    } else if (shared < 2 && a.mask == 2) {
        s = add_only_section(w, &a, &b, &met);
    } else if (shared < 2) {
        s = add_section(w, &a, &b, &met);
        if (!s) s = add_section(w, &b, &a, &met);
    }
    if (met) {
        out->crossing_pairs += !shared;
        out->error = fmax(out->error, fmax(a.moved, b.moved));
    }
    return s;
}

static bool is_flat(const finder *w, uint32_t t)
{
    return !(w->facets[t].height > w->out->tolerance);
}

static sdm_status visit_apart(void *user, uint32_t i, uint32_t j)
{
    finder *w = user;
    if (is_flat(w, i) || is_flat(w, j) || clearly_apart(w, i, j) || clearly_apart(w, j, i))
        return SDM_OK;
    return i < j ? meet(w, i, j, 0) : meet(w, j, i, 0);
}

static sdm_status visit_neighbours(void *user, uint32_t i, uint32_t j, int shared)
{
    finder *w = user;
    if (is_flat(w, i) || is_flat(w, j)) return SDM_OK;
    return meet(w, i, j, shared);
}

/* The contacts in the order of their triangles. */
static sdm_status sort_contacts(const sdm_contact *list, size_t n_tri, sdm_arena *arena,
                                sdm_contacts *c, sdm_error *err)
{
    sdm_status s = SDM_TAKE(arena, SDM_HIGH, &c->first, n_tri + 1, "contacts", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &c->list, c->n, "contacts", err);
    if (s) return s;
    for (size_t i = 0; i < c->n; i++) c->first[list[i].tri + 1]++;
    for (size_t t = 0; t < n_tri; t++) c->first[t + 1] += c->first[t];
    for (size_t i = 0; i < c->n; i++) c->list[c->first[list[i].tri]++] = list[i];
    for (size_t t = n_tri; t > 0; t--) c->first[t] = c->first[t - 1];
    c->first[0] = 0;
    return SDM_OK;
}

sdm_status sdm_contacts_find(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                             const sdm_facet *facets, sdm_arena *arena, sdm_contacts *c,
                             sdm_budget *budget, sdm_error *err)
{
    double largest = 0;
    for (size_t i = 0; i < 3 * m->n_vert; i++)
        largest = fabs(m->vert[i]) > largest ? fabs(m->vert[i]) : largest;
    c->tolerance = 16 * DBL_EPSILON * largest;
    finder w = {.mesh = m, .topo = topo, .facets = facets, .out = c, .budget = budget, .err = err};
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    const size_t fans = sdm_fans_bytes(m->n_vert), pairs = sdm_pairs_bytes(m->n_vert, tree);
    const size_t scratch =
        (fans > pairs ? fans : pairs) + KEPT * (sizeof *w.frame + sizeof *w.frame_of);
    sdm_status s = sdm_budget_take(budget, scratch, err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w.frame, KEPT, "frames of triangles", err);
    if (!s) s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w.frame_of, KEPT, "frames of triangles", err);
    if (!s) memset(w.frame_of, 0xff, KEPT * sizeof *w.frame_of);
    if (!s)
        s = sdm_fans_visit(m, topo, facets, c->tolerance, arena, visit_neighbours, &w, budget, err);
    if (!s) s = sdm_pairs_visit(m, topo, tree, c->tolerance, arena, visit_apart, &w, budget, err);
    sdm_arena_release(arena, SDM_HIGH, before);
    if (!s && budget) budget->used -= scratch;
    if (!s)
        s = sdm_budget_take(budget, (m->n_tri + 1) * sizeof *c->first + c->n * sizeof *c->list,
                            err);
    if (!s) s = sort_contacts(w.list, m->n_tri, arena, c, err);
    sdm_free(w.list);
    return s;
}
