/* Finds pairs of triangles with a common vertex that may also meet elsewhere. The fan of a vertex
 * is the set of triangles around it. A fan is a disc if it is closed, all its normals are within a
 * fixed angle of their mean, and it winds around the vertex exactly once as seen along this mean.
 * Seen along the mean, a disc does not overlap itself, so its triangles meet in common vertices and
 * edges only. This excludes most pairs. */
#include "fan.h"

#include "memory/cancel.h"
#include "sdm/internal/vec3.h"

/* Lower bound on cos(angle between a normal and the mean normal of a disc); it is far above the
 * rounding error of this cosine. */
#define COSINE_MIN 0.25
/* Minimum height of a triangle in a disc, in tolerances: its normal is then accurate to about 1e-3.
 * Long needles are allowed, so that a round face triangulated from its centre is a disc. */
#define HEIGHT_MIN 1e3

typedef struct search {
    const sdm_mesh *mesh;
    const sdm_topology *topo;
    const sdm_facet *facets;
    double height_min;
} search;

/* The fan of one vertex. The members are accumulated over its triangles. */
typedef struct fan {
    double mean[3];  // sum of the unit normals
    double dot_min;  // lower bound on the dot product of each normal with `mean` in a disc
    double side[3];  // a vector perpendicular to `mean`
    uint32_t rounds; // how often the fan winds around the vertex
    bool is_disc;
} fan;

static const double *vertex(const search *w, uint32_t v) { return &w->mesh->vert[3 * (size_t)v]; }

/* Sets `mean` of every fan. is_disc stays true when all its triangles are high enough and every
 * edge has one triangle on each side, so that the fan is closed. */
static void sum_normals(const search *w, fan *list)
{
    const sdm_topology *t = w->topo;
    for (size_t v = 0; v < t->n_vert; v++) list[v] = (fan){.is_disc = true};
    for (size_t i = 0; i < t->n_tri; i++) {
        if (t->edge[3 * i] == SDM_NONE) continue;
        const sdm_facet *f = &w->facets[i];
        const bool is_high = f->height > w->height_min;
        for (size_t k = 0; k < 3; k++) {
            fan *a = &list[t->tri[3 * i + k]];
            v3_along(a->mean, 1, f->n, a->mean);
            a->is_disc = a->is_disc && is_high;
        }
    }
    for (size_t i = 0; i < t->n_edges; i++) {
        const sdm_edge *e = &t->edges[i];
        if (e->n_up != 1 || e->n_down != 1) list[e->lo].is_disc = list[e->hi].is_disc = false;
    }
}

/* Sets `side` and `dot_min` of every fan. */
static void choose_sides(size_t n, fan *list)
{
    for (size_t v = 0; v < n; v++) {
        fan *a = &list[v];
        double axis[3] = {0, 0, 0};
        int least = 0;
        for (int i = 1; i < 3; i++)
            if (fabs(a->mean[i]) < fabs(a->mean[least])) least = i;
        axis[least] = 1;
        v3_cross(a->mean, axis, a->side);
        a->dot_min = COSINE_MIN * v3_norm(a->mean);
    }
}

/* Checks the normals against `mean` and sets `rounds`. When all normals agree with the mean, all
 * triangles of the fan turn in the same direction, seen along the mean, so the number of triangles
 * that cross a fixed half-plane through the vertex is the number of rounds. */
static void count_rounds(const search *w, fan *list)
{
    const sdm_topology *t = w->topo;
    for (size_t i = 0; i < t->n_tri; i++) {
        const uint32_t *v = &t->tri[3 * i];
        const double *n = w->facets[i].n;
        double edge[3][3];
        if (t->edge[3 * i] == SDM_NONE) continue;
        for (int k = 0; k < 3; k++) v3_sub(vertex(w, v[(k + 1) % 3]), vertex(w, v[k]), edge[k]);
        for (int k = 0; k < 3; k++) {
            fan *a = &list[v[k]];
            a->is_disc = a->is_disc && v3_dot(a->mean, n) > a->dot_min;
            a->rounds += v3_dot(edge[k], a->side) < 0 && v3_dot(edge[(k + 2) % 3], a->side) <= 0;
        }
    }
}

/* Corners (numbers 3 * triangle + corner) at the vertices whose fan is not a disc. The corners at
 * vertex v are at[first[v]] .. at[first[v + 1] - 1], in ascending order. */
typedef struct corners {
    uint32_t *first, *at;
} corners;

static sdm_status list_corners(const search *w, const fan *list, sdm_arena *arena, corners *c,
                               sdm_error *err)
{
    const sdm_topology *t = w->topo;
    sdm_status s = SDM_TAKE(arena, SDM_HIGH, &c->first, t->n_vert + 2, "vertices", err);
    if (s) return s;
    uint32_t *next = c->first + 1;
    for (size_t h = 0; h < 3 * t->n_tri; h++)
        if (!list[t->tri[h]].is_disc && t->edge[h] != SDM_NONE) next[t->tri[h] + 1]++;
    for (size_t v = 0; v < t->n_vert; v++) next[v + 1] += next[v];
    s = SDM_TAKE_UNSET(arena, SDM_HIGH, &c->at, next[t->n_vert], "vertices", err);
    for (size_t h = 0; h < 3 * t->n_tri && !s; h++)
        if (!list[t->tri[h]].is_disc && t->edge[h] != SDM_NONE)
            c->at[next[t->tri[h]]++] = (uint32_t)h;
    return s;
}

/* Visits the pairs of triangles around v. A pair is visited only at the lowest of its common
 * vertices, and not at all when the fan of one of these vertices is a disc. */
static sdm_status visit_pairs(const search *w, const fan *list, const corners *c, uint32_t v,
                              sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                              void *user, const sdm_exact_opts *opts, sdm_error *err)
{
    const sdm_topology *t = w->topo;
    for (uint32_t i = c->first[v]; i < c->first[v + 1]; i++) {
        const sdm_status stop = sdm_cancel_check(opts, err);
        if (stop) return stop;
        for (uint32_t j = i + 1; j < c->first[v + 1]; j++) {
            const uint32_t p = c->at[i] / 3, q = c->at[j] / 3;
            const uint32_t *a = &t->tri[3 * (size_t)p], *b = &t->tri[3 * (size_t)q];
            int shared = 0;
            bool skip = false;
            for (int k = 0; k < 3; k++) {
                if (a[k] != b[0] && a[k] != b[1] && a[k] != b[2]) continue;
                shared++;
                skip = skip || a[k] < v || list[a[k]].is_disc;
            }
            const sdm_status s = skip ? SDM_OK : visit(user, p, q, shared);
            if (s) return s;
        }
    }
    return SDM_OK;
}

sdm_status sdm_fans_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_facet *facets,
                          double tolerance, sdm_arena *arena,
                          sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                          void *user, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    const search w = {m, topo, facets, HEIGHT_MIN * tolerance};
    fan *list; // [n_vert]
    corners c = {0};
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &list, m->n_vert, "vertices", err);
    if (s) return s;
    // find which fans are discs
    sum_normals(&w, list);
    choose_sides(m->n_vert, list);
    count_rounds(&w, list);
    bool any = false;
    for (size_t v = 0; v < m->n_vert; v++) {
        list[v].is_disc = list[v].is_disc && list[v].rounds == 1;
        any = any || !list[v].is_disc;
    }
    // visit the pairs around the vertices whose fans are not discs
    if (any) s = list_corners(&w, list, arena, &c, err);
    for (uint32_t v = 0; v < m->n_vert && any && !s; v++)
        if (!list[v].is_disc) s = visit_pairs(&w, list, &c, v, visit, user, arena->opts, err);
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
