/* The triangles around a vertex. Where they are a closed fan whose normals agree with one direction
   and which goes round the vertex once, as seen along that direction, its triangles lie side by
   side: no two of them meet but in what they share. */
#include "fan.h"

#include "sdm/internal/vec3.h"

/* Cosine of the largest angle between a normal and their mean, far from doubt. */
#define AGREE 0.25
/* Least height in tolerances: a normal is then sure to some 1e-3, however long the triangle. More
   is not asked of the shape, so that the needles around the middle of a round face are a disc, how
   many there may be. */
#define SOUND 1e3

typedef struct fan {
    const sdm_mesh *mesh;
    const sdm_topology *topo;
    const sdm_facet *facets;
    double least; // height
} fan;

/* What the triangles around a vertex are, summed up triangle by triangle. */
typedef struct around {
    double mean[3], least; // sum of the normals, and what their product with each must exceed
    double side[3];        // across the mean
    uint32_t rounds;       // how often the triangles go round
    bool is_disc;
} around;

static const double *vertex(const fan *w, uint32_t v) { return &w->mesh->vert[3 * (size_t)v]; }

/* Every edge must have one triangle on each side, so that the triangles are closed fans; all must
 * be sound. */
static void sum_normals(const fan *w, around *list)
{
    const sdm_topology *t = w->topo;
    for (size_t v = 0; v < t->n_vert; v++) list[v] = (around){.is_disc = true};
    for (size_t i = 0; i < t->n_tri; i++) {
        if (t->edge[3 * i] == SDM_NONE) continue;
        const sdm_facet *f = &w->facets[i];
        const bool is_sound = f->height > w->least;
        for (size_t k = 0; k < 3; k++) {
            around *a = &list[t->tri[3 * i + k]];
            v3_along(a->mean, 1, f->n, a->mean);
            a->is_disc = a->is_disc && is_sound;
        }
    }
    for (size_t i = 0; i < t->n_edges; i++) {
        const sdm_edge *e = &t->edges[i];
        if (e->n_up != 1 || e->n_down != 1) list[e->lo].is_disc = list[e->hi].is_disc = false;
    }
}

static void choose_sides(size_t n, around *list)
{
    for (size_t v = 0; v < n; v++) {
        around *a = &list[v];
        double axis[3] = {0, 0, 0};
        int least = 0;
        for (int i = 1; i < 3; i++)
            if (fabs(a->mean[i]) < fabs(a->mean[least])) least = i;
        axis[least] = 1;
        v3_cross(a->mean, axis, a->side);
        a->least = AGREE * v3_norm(a->mean);
    }
}

/* The triangles around a vertex are a disc, seen from one side without overlap: their normals agree
   with the mean and they go round once. All turn the same way then: how often they pass a
   half-plane through the vertex is how often they go round. */
static void count_rounds(const fan *w, around *list)
{
    const sdm_topology *t = w->topo;
    for (size_t i = 0; i < t->n_tri; i++) {
        const uint32_t *v = &t->tri[3 * i];
        const double *n = w->facets[i].n;
        double edge[3][3];
        if (t->edge[3 * i] == SDM_NONE) continue;
        for (int k = 0; k < 3; k++) v3_sub(vertex(w, v[(k + 1) % 3]), vertex(w, v[k]), edge[k]);
        for (int k = 0; k < 3; k++) {
            around *a = &list[v[k]];
            a->is_disc = a->is_disc && v3_dot(a->mean, n) > a->least;
            a->rounds += v3_dot(edge[k], a->side) < 0 && v3_dot(edge[(k + 2) % 3], a->side) <= 0;
        }
    }
}

/* Corners (3 * triangle + corner) of the vertices that are no disc, rising: at[first[v]] ..
 * at[first[v + 1]). */
typedef struct corners {
    uint32_t *first, *at;
} corners;

static sdm_status list_corners(const fan *w, const around *list, sdm_arena *arena, corners *c,
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

/* Pairs around v, each at the first of the vertices it shares; none when a shared vertex is one of
 * a disc. */
static sdm_status visit_pairs(const fan *w, const around *list, const corners *c, uint32_t v,
                              sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                              void *user, const sdm_budget *budget, sdm_error *err)
{
    const sdm_topology *t = w->topo;
    for (uint32_t i = c->first[v]; i < c->first[v + 1]; i++) {
        const sdm_status stop = sdm_budget_ask(budget, err);
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

size_t sdm_fans_bytes(size_t n_vert) { return n_vert * (sizeof(around) + sizeof(uint32_t)); }

sdm_status sdm_fans_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_facet *facets,
                          double tolerance, sdm_arena *arena,
                          sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                          void *user, const sdm_budget *budget, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    const fan w = {m, topo, facets, SOUND * tolerance};
    around *list;
    corners c = {0};
    sdm_status s = SDM_TAKE_UNSET(arena, SDM_HIGH, &list, m->n_vert, "vertices", err);
    if (s) return s;
    sum_normals(&w, list);
    choose_sides(m->n_vert, list);
    count_rounds(&w, list);
    bool any = false;
    for (size_t v = 0; v < m->n_vert; v++) {
        list[v].is_disc = list[v].is_disc && list[v].rounds == 1;
        any = any || !list[v].is_disc;
    }
    if (any) s = list_corners(&w, list, arena, &c, err);
    for (uint32_t v = 0; v < m->n_vert && any && !s; v++)
        if (!list[v].is_disc) s = visit_pairs(&w, list, &c, v, visit, user, budget, err);
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
