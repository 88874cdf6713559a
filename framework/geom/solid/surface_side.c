/* Computes winding numbers just outside the surface. On a triangle that other triangles cross, the
 * winding number is carried along a straight path from a start point where it is known: it changes
 * by one at every contact segment that the path crosses. A ray is cast instead where the path is
 * too close to the end of a segment, where triangles touch in corners, edges or planes, and where
 * no start point is known. */
#include "surface_side.h"

#include "mesh/crossings.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/vec3.h"

// Minimum distance of the path from the ends of segments, in tolerances. Segments that meet in one
// point by exact arithmetic end closer to each other than this.
#define MARGIN 64.0
// For triangles with more contacts a ray is faster than the path.
#define WALK_CONTACTS_MAX 64

bool sdm_sides_is_sliver(const sdm_survey *survey, uint32_t t)
{
    return !(survey->facets[t].height > survey->contacts.tolerance);
}

static bool meets_nothing(const sdm_survey *survey, uint32_t t)
{
    return survey->contacts.first[t] == survey->contacts.first[t + 1];
}

/* Winding number at x just outside triangle t, by a ray that ignores the triangles skip[n_skip]. */
static int ray_winding(const sdm_sides *w, uint32_t t, const double x[3], const uint32_t *skip,
                       size_t n_skip)
{
    return sdm_ray_winding_along(w->mesh, &w->survey->tree, x, w->survey->facets[t].n, skip,
                                 n_skip);
}

/* parent[n_tri] = union-find forest of the patches: neighbouring triangles without contacts that
 * are not slivers. */
static void join_patches(const sdm_survey *survey, uint32_t *parent)
{
    for (uint32_t t = 0; t < survey->topo.n_tri; t++) parent[t] = t;
    for (size_t i = 0; i < survey->topo.n_edges; i++) {
        const sdm_edge *e = &survey->topo.edges[i];
        if (e->n_up != 1 || e->n_down != 1) continue;
        const uint32_t t = e->first / 3, o = survey->topo.next[e->first] / 3;
        if (meets_nothing(survey, t) && meets_nothing(survey, o) &&
            !sdm_sides_is_sliver(survey, t) && !sdm_sides_is_sliver(survey, o))
            sdm_forest_join(parent, t, o);
    }
}

sdm_status sdm_sides_build(const sdm_mesh *m, const sdm_survey *survey, sdm_arena *arena,
                           sdm_sides *w, sdm_error *err)
{
    w->mesh = m;
    w->survey = survey;
    const sdm_facet *f = survey->facets;
    uint32_t *parent = NULL, *largest = NULL;
    sdm_status s = SDM_TAKE(arena, SDM_HIGH, &w->outside, m->n_tri, "patches", err);
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &parent, m->n_tri, "patches", err);
    if (!s) s = SDM_TAKE(arena, SDM_HIGH, &largest, m->n_tri, "patches", err);
    if (!s) {
        join_patches(survey, parent);
        for (uint32_t t = 0; t < m->n_tri; t++) {
            const uint32_t root = parent[t] = sdm_forest_root(parent, t), l = largest[root];
            if (root == t || f[t].longest * f[t].height > f[l].longest * f[l].height)
                largest[root] = t;
        }
        // Cast a ray from the largest triangle of each patch. The root of a patch is its triangle
        // of lowest index, so the loop reaches the root before the patch's other triangles.
        for (uint32_t t = 0; t < m->n_tri; t++) {
            if (!meets_nothing(survey, t) || sdm_sides_is_sliver(survey, t)) continue;
            const uint32_t l = largest[t];
            double x[3];
            if (parent[t] == t) sdm_facet_centre(m, l, x);
            w->outside[t] = parent[t] == t ? ray_winding(w, l, x, &l, 1) : w->outside[parent[t]];
        }
    }
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}

void sdm_sides_dispose(sdm_sides *w)
{
    sdm_free(w->skip);
    *w = (sdm_sides){0};
}

bool sdm_sides_keep_whole(const sdm_sides *w, uint32_t t) { return w->outside[t] == 0; }

void sdm_sides_turn_to(sdm_sides *w, uint32_t t)
{
    const sdm_contacts *c = &w->survey->contacts;
    w->tri = t;
    sdm_facet_frame(w->mesh, t, &w->frame);
    w->known = false;
    // paths are possible if the triangle has few contacts, all of them crossings
    w->simple = c->first[t + 1] - c->first[t] <= WALK_CONTACTS_MAX;
    for (uint32_t i = c->first[t]; i < c->first[t + 1] && w->simple; i++)
        w->simple = c->list[i].kind == SDM_CONTACT_CROSSING;
    // the start point: the midpoint of an edge to a neighbour without contacts
    for (uint32_t k = 0; k < 3 && w->simple && !w->known; k++) {
        const uint32_t o = sdm_topology_neighbour(&w->survey->topo, 3 * t + k);
        if (o == SDM_NONE || !meets_nothing(w->survey, o) || sdm_sides_is_sliver(w->survey, o))
            continue;
        const uint32_t *v = &w->mesh->tri[3 * (size_t)t];
        double middle[3];
        for (size_t i = 0; i < 3; i++)
            middle[i] = 0.5 * (w->mesh->vert[3 * (size_t)v[k] + i] +
                               w->mesh->vert[3 * (size_t)v[(k + 1) % 3] + i]);
        sdm_frame_flatten(&w->frame, middle, w->start);
        w->start_outside = w->outside[o];
        w->known = true;
    }
}

/* (b - a) x (c - a) */
static double cross2(const double a[2], const double b[2], const double c[2])
{
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

static double distance2d(const double a[2], const double b[2])
{
    const double x = b[0] - a[0], y = b[1] - a[1];
    return sqrt(x * x + y * y);
}

/* If the path from a to b crosses the segment of contact c, adds the resulting change (+1 or -1) of
 * the winding number to *change. Returns false when this cannot be decided: a or b is too close to
 * the line of the segment, or an end of the segment is too close to the line of the path. */
static bool contact_pass(const sdm_sides *w, const sdm_contact *c, const double a[2],
                         const double b[2], int *change)
{
    const double margin = MARGIN * w->survey->contacts.tolerance;
    const double length = margin * distance2d(c->p, c->q), way = margin * distance2d(a, b);
    const double ha = cross2(c->p, c->q, a), hb = cross2(c->p, c->q, b);
    const double hp = cross2(a, b, c->p), hq = cross2(a, b, c->q);
    if (!(fabs(ha) > length && fabs(hb) > length)) return false;
    if ((ha > 0) == (hb > 0)) return true;
    if (!(fabs(hp) > way && fabs(hq) > way)) return false;
    if ((hp > 0) == (hq > 0)) return true;
    // a path in the direction of the other triangle's normal leaves the volume that it bounds
    const double *n = w->survey->facets[c->other].n;
    const double along =
        (b[0] - a[0]) * v3_dot(n, w->frame.u) + (b[1] - a[1]) * v3_dot(n, w->frame.v);
    *change += along > 0 ? -1 : 1;
    return true;
}

/* Sets *outside to the winding number just outside the current triangle at xy, by a path from the
 * triangle's start point. Returns false when this is not possible. */
static bool walk_to(const sdm_sides *w, const double xy[2], int *outside)
{
    const sdm_contacts *c = &w->survey->contacts;
    int change = 0;
    if (!w->known) return false;
    for (uint32_t i = c->first[w->tri]; i < c->first[w->tri + 1]; i++)
        if (!contact_pass(w, &c->list[i], w->start, xy, &change)) return false;
    *outside = w->start_outside + change;
    return true;
}

/* Is the projection of x in the interior of triangle t? */
static bool on_triangle(const sdm_mesh *m, uint32_t t, const double x[3])
{
    sdm_frame f;
    double p[2];
    sdm_facet_frame(m, t, &f);
    sdm_frame_flatten(&f, x, p);
    return p[1] > 0 && f.e1y * p[0] - f.e1x * p[1] - f.kh1 < 0 && f.e2y * p[0] - f.e2x * p[1] < 0;
}

/* Does the work of sdm_sides_keep() by a ray from x, the point at xy. The ray skips the current
 * triangle and its coplanar contacts, which together count as one layer. If paths are possible on
 * the triangle, x becomes their start point. */
static sdm_status keep_by_ray(sdm_sides *w, const double xy[2], const double x[3], bool *keep,
                              sdm_error *err)
{
    const sdm_contacts *c = &w->survey->contacts;
    const uint32_t t = w->tri;
    const size_t n = c->first[t + 1] - c->first[t];
    if (n + 1 > w->cap_skip) {
        const sdm_status s =
            sdm_grow((void **)&w->skip, 0, 2 * n + 16, sizeof *w->skip, "coplanar triangles", err);
        if (s) return s;
        w->cap_skip = 2 * n + 16;
    }
    size_t n_skip = 0;
    // jump: change of the winding number from outside to inside across all coincident triangles at
    // x; first: the current triangle has the lowest index among those of its orientation
    int jump = 1;
    bool first = true;
    w->skip[n_skip++] = t;
    for (uint32_t i = c->first[t]; i < c->first[t + 1]; i++) {
        if (c->list[i].kind != SDM_CONTACT_COPLANAR) continue;
        const uint32_t o = c->list[i].other;
        w->skip[n_skip++] = o;
        if (!on_triangle(w->mesh, o, x)) continue;
        const bool same = v3_dot(w->survey->facets[t].n, w->survey->facets[o].n) > 0;
        jump += same ? 1 : -1;
        if (same && o < t) first = false;
    }
    const int outside = ray_winding(w, t, x, w->skip, n_skip);
    *keep = first && outside <= 0 && outside + jump >= 1;
    if (w->simple && !w->known) {
        w->known = true;
        w->start[0] = xy[0];
        w->start[1] = xy[1];
        w->start_outside = outside;
    }
    return SDM_OK;
}

sdm_status sdm_sides_keep(sdm_sides *w, const double xy[2], bool *keep, sdm_error *err)
{
    int outside;
    if (walk_to(w, xy, &outside)) {
        *keep = outside == 0;
        return SDM_OK;
    }
    double x[3];
    sdm_frame_lift(&w->frame, xy, x);
    return keep_by_ray(w, xy, x, keep, err);
}
