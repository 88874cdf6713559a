/* Winding numbers just outside of the surface. A place on a triangle that others pass through is
   reached from a place where the number is known: it changes by one at each segment on the way.
   Where a segment is met too close to its end to be sure, where triangles touch in corners, edges
   or planes, and where there is no known place, a ray is sent. */
#include "surface_side.h"

#include "mesh/crossings.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

#define MARGIN 64.0      // in tolerances: segments that belong together end closer to each other
#define MOST_CONTACTS 64 // with more of them a ray is faster than the walk

bool sdm_sides_flat(const sdm_survey *s, uint32_t t)
{
    return !(s->facets[t].height > s->contacts.tolerance);
}

static bool meets_nothing(const sdm_survey *s, uint32_t t)
{
    return s->contacts.first[t] == s->contacts.first[t + 1];
}

static int ray(const sdm_sides *s, uint32_t t, const double x[3], const uint32_t *skip,
               size_t n_skip)
{
    return sdm_ray_winding_along(s->mesh, &s->survey->tree, x, s->survey->facets[t].n, skip,
                                 n_skip);
}

/* Joins neighbours that meet nothing: parent[n_tri] becomes a forest of patches. */
static void join_patches(const sdm_survey *s, uint32_t *parent)
{
    for (uint32_t t = 0; t < s->topo.n_tri; t++) parent[t] = t;
    for (size_t i = 0; i < s->topo.n_edges; i++) {
        const sdm_edge *e = &s->topo.edges[i];
        if (e->n_up != 1 || e->n_down != 1) continue;
        const uint32_t t = e->first / 3, o = s->topo.next[e->first] / 3;
        if (meets_nothing(s, t) && meets_nothing(s, o) && !sdm_sides_flat(s, t) &&
            !sdm_sides_flat(s, o))
            sdm_forest_join(parent, t, o);
    }
}

sdm_status sdm_sides_build(const sdm_mesh *m, const sdm_survey *survey, sdm_arena *arena,
                           sdm_sides *s, sdm_error *err)
{
    s->mesh = m;
    s->survey = survey;
    const sdm_facet *f = survey->facets;
    uint32_t *parent = NULL, *largest = NULL;
    sdm_status st = SDM_TAKE(arena, SDM_HIGH, &s->outside, m->n_tri, "patches", err);
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    if (!st) st = SDM_TAKE(arena, SDM_HIGH, &parent, m->n_tri, "patches", err);
    if (!st) st = SDM_TAKE(arena, SDM_HIGH, &largest, m->n_tri, "patches", err);
    if (!st) {
        join_patches(survey, parent);
        for (uint32_t t = 0; t < m->n_tri; t++) {
            const uint32_t root = parent[t] = sdm_forest_root(parent, t), l = largest[root];
            if (root == t || f[t].longest * f[t].height > f[l].longest * f[l].height)
                largest[root] = t;
        }
        // roots are the first of their patches
        for (uint32_t t = 0; t < m->n_tri; t++) {
            if (!meets_nothing(survey, t) || sdm_sides_flat(survey, t)) continue;
            const uint32_t l = largest[t];
            double x[3];
            if (parent[t] == t) sdm_facet_centre(m, l, x);
            s->outside[t] = parent[t] == t ? ray(s, l, x, &l, 1) : s->outside[parent[t]];
        }
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return st;
}

void sdm_sides_dispose(sdm_sides *s)
{
    sdm_free(s->skip);
    *s = (sdm_sides){0};
}

bool sdm_sides_keep_whole(const sdm_sides *s, uint32_t t) { return s->outside[t] == 0; }

void sdm_sides_turn_to(sdm_sides *s, uint32_t t)
{
    const sdm_contacts *c = &s->survey->contacts;
    s->tri = t;
    sdm_facet_frame(s->mesh, t, &s->frame);
    s->known = false;
    s->simple = c->first[t + 1] - c->first[t] <= MOST_CONTACTS;
    for (uint32_t i = c->first[t]; i < c->first[t + 1] && s->simple; i++)
        s->simple = c->list[i].kind == SDM_CONTACT_CROSSING;
    for (uint32_t k = 0; k < 3 && s->simple && !s->known; k++) {
        const uint32_t o = sdm_topology_neighbour(&s->survey->topo, 3 * t + k);
        if (o == SDM_NONE || !meets_nothing(s->survey, o) || sdm_sides_flat(s->survey, o)) continue;
        const uint32_t *v = &s->mesh->tri[3 * (size_t)t];
        double middle[3];
        for (size_t i = 0; i < 3; i++)
            middle[i] = 0.5 * (s->mesh->vert[3 * (size_t)v[k] + i] +
                               s->mesh->vert[3 * (size_t)v[(k + 1) % 3] + i]);
        sdm_frame_flatten(&s->frame, middle, s->start);
        s->start_outside = s->outside[o];
        s->known = true;
    }
}

static double cross2(const double a[2], const double b[2], const double c[2])
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static double distance2d(const double a[2], const double b[2])
{
    const double x = b[0] - a[0], y = b[1] - a[1];
    return sqrt(x * x + y * y);
}

/* Change of the winding number on the way from a to b across the segment of a contact; false when
 * it is too close to call. */
static bool pass(const sdm_sides *s, const sdm_contact *c, const double a[2], const double b[2],
                 int *change)
{
    const double margin = MARGIN * s->survey->contacts.tolerance;
    const double length = margin * distance2d(c->p, c->q), way = margin * distance2d(a, b);
    const double ha = cross2(c->p, c->q, a), hb = cross2(c->p, c->q, b);
    const double hp = cross2(a, b, c->p), hq = cross2(a, b, c->q);
    if (!(fabs(ha) > length && fabs(hb) > length)) return false;
    if ((ha > 0) == (hb > 0)) return true;
    if (!(fabs(hp) > way && fabs(hq) > way)) return false;
    if ((hp > 0) == (hq > 0)) return true;
    // going along the other triangle's normal leaves what it bounds
    const double *n = s->survey->facets[c->other].n;
    const double along =
        (b[0] - a[0]) * v3_dot(n, s->frame.u) + (b[1] - a[1]) * v3_dot(n, s->frame.v);
    *change += along > 0 ? -1 : 1;
    return true;
}

/* Carries the known winding number on to xy. */
static bool walk_to(const sdm_sides *s, const double xy[2], int *outside)
{
    const sdm_contacts *c = &s->survey->contacts;
    int change = 0;
    if (!s->known) return false;
    for (uint32_t i = c->first[s->tri]; i < c->first[s->tri + 1]; i++)
        if (!pass(s, &c->list[i], s->start, xy, &change)) return false;
    *outside = s->start_outside + change;
    return true;
}

static bool on_triangle(const sdm_mesh *m, uint32_t t, const double x[3])
{
    sdm_frame f;
    double p[2];
    sdm_facet_frame(m, t, &f);
    sdm_frame_flatten(&f, x, p);
    return p[1] > 0 && f.e1y * p[0] - f.e1x * p[1] - f.kh1 < 0 && f.e2y * p[0] - f.e2x * p[1] < 0;
}

/* By a ray from x, with the triangles that lie on the one at hand taken together. */
static sdm_status keep_by_ray(sdm_sides *s, const double xy[2], const double x[3], bool *keep,
                              sdm_error *err)
{
    const sdm_contacts *c = &s->survey->contacts;
    const uint32_t t = s->tri;
    const size_t n = c->first[t + 1] - c->first[t];
    if (n + 1 > s->cap_skip) {
        const sdm_status st =
            sdm_grow((void **)&s->skip, 0, 2 * n + 16, sizeof *s->skip, "coplanar triangles", err);
        if (st) return st;
        s->cap_skip = 2 * n + 16;
    }
    size_t n_skip = 0;
    int jump = 1; // of the winding number on the way in, with all that lies on the triangle here
    bool first = true;
    s->skip[n_skip++] = t;
    for (uint32_t i = c->first[t]; i < c->first[t + 1]; i++) {
        if (c->list[i].kind != SDM_CONTACT_COPLANAR) continue;
        const uint32_t o = c->list[i].other;
        s->skip[n_skip++] = o;
        if (!on_triangle(s->mesh, o, x)) continue;
        const bool same = v3_dot(s->survey->facets[t].n, s->survey->facets[o].n) > 0;
        jump += same ? 1 : -1;
        if (same && o < t) first = false;
    }
    const int outside = ray(s, t, x, s->skip, n_skip);
    *keep = first && outside <= 0 && outside + jump >= 1;
    if (s->simple && !s->known) {
        s->known = true;
        s->start[0] = xy[0];
        s->start[1] = xy[1];
        s->start_outside = outside;
    }
    return SDM_OK;
}

sdm_status sdm_sides_keep(sdm_sides *s, const double xy[2], bool *keep, sdm_error *err)
{
    int outside;
    if (walk_to(s, xy, &outside)) {
        *keep = outside == 0;
        return SDM_OK;
    }
    double x[3];
    sdm_frame_lift(&s->frame, xy, x);
    return keep_by_ray(s, xy, x, keep, err);
}
