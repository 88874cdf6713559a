/* Self-intersections of a mesh. Candidate pairs of triangles without a common vertex come from the
 * tree (pairs.h), pairs with a common vertex from the fans around the vertices (fan.h). The segment
 * in which two triangles meet is clipped in the frame of each triangle. */
#include "contact.h"

#include <float.h>
#include <string.h>

#include "fan.h"
#include "pairs.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

// Size of the cache of frames. It is useful because a triangle that meets others occurs in many
// pairs.
#define FRAMES_KEPT 256u

typedef struct finder {
    const sdm_mesh *mesh;
    const sdm_topology *topo;
    const sdm_facet *facets;
    sdm_contacts *out;
    sdm_contact *list; // [cap] contacts in the order in which they are found
    size_t cap;
    // [FRAMES_KEPT] direct-mapped cache: frame[i] is the frame of triangle frame_of[i]; triangle t
    // can be at i = t % FRAMES_KEPT only
    sdm_frame *frame;
    uint32_t *frame_of;
    sdm_arena *arena;
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

/* Coordinates of corner i of triangle t. */
static const double *corner(const finder *w, uint32_t t, int i)
{
    return &w->mesh->vert[3 * (size_t)w->topo->tri[3 * (size_t)t + (size_t)i]];
}

static sdm_status contact_add(finder *w, sdm_contact c)
{
    sdm_contacts *out = w->out;
    // limit for meshes with many coincident layers: k layers give about k^2 contacts
    const size_t n_max = 64 * w->topo->n_tri + ((size_t)1 << 20);
    if (out->n == n_max)
        return sdm_fail(w->err, SDM_E_MESH,
                        "triangles of the mesh touch or cross each other more than %zu times: "
                        "remove its duplicate layers",
                        n_max);
    if (out->n == w->cap) {
        const size_t cap = w->cap ? 2 * w->cap : 256;
        sdm_status s = sdm_arena_charge(w->arena, (cap - w->cap) * sizeof *w->list, w->err);
        if (!s) s = sdm_grow((void **)&w->list, out->n, cap, sizeof *w->list, "contacts", w->err);
        if (s) return s;
        w->cap = cap;
    }
    w->list[out->n++] = c;
    return SDM_OK;
}

/* *f = the frame of triangle t, from the cache where possible. */
static void frame_get(const finder *w, uint32_t t, sdm_frame *f)
{
    sdm_frame *kept = &w->frame[t % FRAMES_KEPT];
    if (w->frame_of[t % FRAMES_KEPT] != t) sdm_facet_frame(w->mesh, t, kept);
    w->frame_of[t % FRAMES_KEPT] = t;
    *f = *kept;
}

/* One triangle of a pair. */
typedef struct pair_tri {
    uint32_t tri;
    sdm_frame frame;
    // signed distances of the triangle's corners from the plane of the other triangle, mm; a
    // distance not larger than its error becomes 0
    double d[3];
    double moved; // largest abs(distance) that was set to 0, mm
    int mask;     // sum of the signs that occur in d: 1 negative, 2 zero, 4 positive
} pair_tri;

/* Fills s->d: distances of the corners of s from the plane of `other`. The error of that plane is
 * the tolerance at the triangle `other` itself and grows linearly with the distance from this
 * triangle: along its longest edge in units of the edge's length, across the edge in units of the
 * height. */
static void plane_distances(const finder *w, pair_tri *s, const pair_tri *other)
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

/* Fast rejection of most pairs: does triangle j lie on one side of the plane of i by more than the
 * error of the distances? */
static bool clearly_apart(const finder *w, uint32_t i, uint32_t j)
{
    const sdm_facet *f = &w->facets[i];
    const double *a = corner(w, i, 0), tolerance = 4 * w->out->tolerance;
    int above = 0, below = 0;
    for (int k = 0; k < 3; k++) {
        double r[3];
        v3_sub(corner(w, j, k), a, r);
        const double d = v3_dot(r, f->n) * f->height;
        const double error = tolerance * (f->height + fabs(r[0]) + fabs(r[1]) + fabs(r[2]));
        above += d > error;
        below += d < -error;
    }
    return above == 3 || below == 3;
}

/* Clips the segment p q, in the coordinates of frame f, to its triangle enlarged by the tolerance.
 * Returns false when the clipped segment is not longer than 4 tolerances. */
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

/* Sets p[2] to the end points of the segment in which triangle s meets the plane of the other
 * triangle. Returns false when triangle and plane meet in one point or not at all. */
static bool plane_section(const finder *w, const pair_tri *s, double p[2][3])
{
    const double *d = s->d;
    int n = 0;
    // corners on the plane, then edges that cross it
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

/* Adds a contact of triangle `on`: takes the segment in which `other` meets the plane of `on`,
 * clipped to `on`. Sets *met to true if there is such a contact; otherwise *met is unchanged. */
static sdm_status add_section(finder *w, const pair_tri *on, const pair_tri *other, bool *met)
{
    double p[2][3];
    if (!plane_section(w, other, p)) return SDM_OK;
    sdm_contact c = {.tri = on->tri, .other = other->tri, .kind = SDM_CONTACT_TOUCH};
    if (on->mask == 5 && other->mask == 5) c.kind = SDM_CONTACT_CROSSING;
    sdm_frame_flatten(&on->frame, p[0], c.p);
    sdm_frame_flatten(&on->frame, p[1], c.q);
    if (!clip_segment(&on->frame, w->out->tolerance, c.p, c.q)) return SDM_OK;
    *met = true;
    return contact_add(w, c);
}

/* Adds the contact segment computed on triangle `on` as a contact of both triangles. Used when all
 * corners of `on` lie on the plane of `other` within the error of that plane, so that no segment on
 * `other` can be computed. */
static sdm_status add_common_section(finder *w, const pair_tri *on, const pair_tri *other,
                                     bool *met)
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
    return contact_add(w, c);
}

/* Do two coplanar triangles overlap by more than a strip 4 tolerances wide? They do not if all
 * corners of one triangle lie outside of an edge line of the other, or at most 4 tolerances inside
 * this line (separating axes). */
static bool covers(const finder *w, const pair_tri *a, const pair_tri *b)
{
    for (int turn = 0; turn < 2; turn++) {
        const sdm_frame *f = turn ? &b->frame : &a->frame;
        const uint32_t other = turn ? a->tri : b->tri;
        double lowest[3] = {INFINITY, INFINITY, INFINITY};
        for (int k = 0; k < 3; k++) {
            double x[2];
            sdm_frame_flatten(f, corner(w, other, k), x);
            lowest[0] = fmin(lowest[0], -x[1]);
            lowest[1] = fmin(lowest[1], f->e1y * x[0] - f->e1x * x[1] - f->kh1);
            lowest[2] = fmin(lowest[2], f->e2y * x[0] - f->e2x * x[1]);
        }
        for (int k = 0; k < 3; k++)
            if (!(lowest[k] < -4 * w->out->tolerance)) return false;
    }
    return true;
}

/* Adds the contacts of `on` with a coplanar triangle that overlaps it: the overlap itself, and a
 * segment for each edge of `other` that runs over `on`. */
static sdm_status add_coplanar(finder *w, const pair_tri *on, const pair_tri *other)
{
    sdm_status s = contact_add(
        w, (sdm_contact){.tri = on->tri, .other = other->tri, .kind = SDM_CONTACT_COPLANAR});
    for (int k = 0; k < 3 && !s; k++) {
        sdm_contact c = {.tri = on->tri, .other = other->tri, .kind = SDM_CONTACT_TOUCH};
        sdm_frame_flatten(&on->frame, corner(w, other->tri, k), c.p);
        sdm_frame_flatten(&on->frame, corner(w, other->tri, (k + 1) % 3), c.q);
        if (clip_segment(&on->frame, w->out->tolerance, c.p, c.q)) s = contact_add(w, c);
    }
    return s;
}

/* Finds the contacts of triangles i < j, which have `shared` common vertices. */
static sdm_status pair_intersect(finder *w, uint32_t i, uint32_t j, int shared)
{
    sdm_contacts *out = w->out;
    pair_tri a = {.tri = i}, b = {.tri = j};
    frame_get(w, i, &a.frame);
    frame_get(w, j, &b.frame);
    // no contact if one triangle is strictly on one side of the other's plane
    plane_distances(w, &b, &a);
    if (b.mask == 1 || b.mask == 4) return SDM_OK;
    if (shared && (b.mask == 3 || b.mask == 6)) {
        // j is on one side of the plane of i: the triangles meet in the common vertices only,
        // unless another corner of j is on the plane as well
        if ((b.d[0] == 0) + (b.d[1] == 0) + (b.d[2] == 0) == shared) return SDM_OK;
    }
    plane_distances(w, &a, &b);
    if (a.mask == 1 || a.mask == 4) return SDM_OK;

    // three cases: coplanar triangles; one triangle in the plane of the other, within the error of
    // that plane; the general case
    sdm_status s = SDM_OK;
    bool met = false;
    if (b.mask == 2 && a.mask == 2) {
        met = covers(w, &a, &b);
        if (met) s = add_coplanar(w, &a, &b);
        if (met && !s) s = add_coplanar(w, &b, &a);
    } else if (shared < 2 && b.mask == 2) {
        s = add_common_section(w, &b, &a, &met);
    } else if (shared < 2 && a.mask == 2) {
        s = add_common_section(w, &a, &b, &met);
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

/* Is triangle t a sliver: not higher than the tolerance? Slivers have no contacts. */
static bool is_sliver(const finder *w, uint32_t t)
{
    return !(w->facets[t].height > w->out->tolerance);
}

static sdm_status visit_apart(void *user, uint32_t i, uint32_t j)
{
    finder *w = user;
    if (is_sliver(w, i) || is_sliver(w, j) || clearly_apart(w, i, j) || clearly_apart(w, j, i))
        return SDM_OK;
    return i < j ? pair_intersect(w, i, j, 0) : pair_intersect(w, j, i, 0);
}

static sdm_status visit_neighbours(void *user, uint32_t i, uint32_t j, int shared)
{
    finder *w = user;
    if (is_sliver(w, i) || is_sliver(w, j)) return SDM_OK;
    return pair_intersect(w, i, j, shared);
}

/* Counting sort of list[c->n] by triangle into c->list and c->first. */
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
                             sdm_error *err)
{
    double largest = 0;
    for (int d = 0; d < 3; d++)
        largest = fmax(largest, fmax(fabs(tree->node->lo[d]), fabs(tree->node->hi[d])));
    c->tolerance = 16 * DBL_EPSILON * largest;
    finder w = {.mesh = m, .topo = topo, .facets = facets, .out = c, .arena = arena, .err = err};
    // find the contacts, in the order of the pairs
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    sdm_status s =
        SDM_TAKE_UNSET(arena, SDM_HIGH, &w.frame, FRAMES_KEPT, "frames of triangles", err);
    if (!s)
        s = SDM_TAKE_UNSET(arena, SDM_HIGH, &w.frame_of, FRAMES_KEPT, "frames of triangles", err);
    if (!s) memset(w.frame_of, 0xff, FRAMES_KEPT * sizeof *w.frame_of);
    if (!s) s = sdm_fans_visit(m, topo, facets, c->tolerance, arena, visit_neighbours, &w, err);
    if (!s) s = sdm_pairs_visit(m, topo, tree, c->tolerance, arena, visit_apart, &w, err);
    sdm_arena_release(arena, SDM_HIGH, before);
    // sort them by triangle
    if (!s) s = sort_contacts(w.list, m->n_tri, arena, c, err);
    sdm_free(w.list);
    arena->used -= w.cap * sizeof *w.list;
    return s;
}
