/* The triangles around a vertex. Where they are a closed fan whose normals agree with one direction and which goes round the
   vertex once, as seen along that direction, its triangles lie side by side: no two of them meet but in what they share. */
#include "fan.h"

#include "vec3.h"

/* Cosine of the largest angle between a normal and their mean, and the least height over longest edge: far from doubt. */
#define AGREE 0.25
#define SOUND 1e-3

typedef struct fan {
    const sdm_mesh *mesh;
    const sdm_topology *topo;
    const sdm_facet *facets;
    double least; // height
} fan;

static const double *vertex(const fan *w, uint32_t v) { return &w->mesh->vert[3 * (size_t)v]; }

/* Every edge at v has one triangle on each side, so the triangles are closed fans; and all are sound and seen from one side. */
static bool faces_one_side(const fan *w, uint32_t v, double mean[3])
{
    const sdm_topology *t = w->topo;
    mean[0] = mean[1] = mean[2] = 0;
    for (uint32_t i = t->first[v]; i < t->first[v + 1]; i++) {
        const sdm_facet *f = &w->facets[t->leaving[i] / 3];
        const sdm_edge *e = &t->edges[t->edge[t->leaving[i]]];
        if (!(f->height > SOUND * f->longest && f->height > w->least) || e->n_up != 1 || e->n_down != 1) return false;
        v3_along(mean, 1, f->n, mean);
    }
    const double least = AGREE * v3_norm(mean);
    for (uint32_t i = t->first[v]; i < t->first[v + 1]; i++)
        if (!(v3_dot(mean, w->facets[t->leaving[i] / 3].n) > least)) return false;
    return true;
}

/* The triangles around v are a disc, seen from one side without overlap. */
static bool is_disc(const fan *w, uint32_t v)
{
    const sdm_topology *t = w->topo;
    double mean[3], axis[3] = {0, 0, 0}, side[3];
    if (!faces_one_side(w, v, mean)) return false;
    int least = 0;
    for (int i = 1; i < 3; i++)
        if (fabs(mean[i]) < fabs(mean[least])) least = i;
    axis[least] = 1;
    v3_cross(mean, axis, side);
    // all triangles turn the same way: how often they pass a half-plane through v is how often they go round
    int rounds = 0;
    for (uint32_t i = t->first[v]; i < t->first[v + 1]; i++) {
        const uint32_t h = t->leaving[i], corner = h % 3, *tri = &t->tri[h - corner];
        double to[3], from[3];
        v3_sub(vertex(w, tri[(corner + 1) % 3]), vertex(w, v), from);
        v3_sub(vertex(w, tri[(corner + 2) % 3]), vertex(w, v), to);
        rounds += v3_dot(from, side) < 0 && v3_dot(to, side) >= 0;
    }
    return rounds == 1;
}

/* Pairs around v, each at the first of the vertices it shares; none when a shared vertex is one of a disc. */
static sdm_status visit_pairs(const fan *w, const bool *disc, uint32_t v,
                              sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared), void *user)
{
    const sdm_topology *t = w->topo;
    for (uint32_t i = t->first[v]; i < t->first[v + 1]; i++) {
        for (uint32_t j = i + 1; j < t->first[v + 1]; j++) {
            const uint32_t p = t->leaving[i] / 3, q = t->leaving[j] / 3;
            const uint32_t *a = &t->tri[3 * (size_t)p], *b = &t->tri[3 * (size_t)q];
            int shared = 0;
            bool skip = false;
            for (int k = 0; k < 3; k++) {
                if (a[k] != b[0] && a[k] != b[1] && a[k] != b[2]) continue;
                shared++;
                skip = skip || a[k] < v || disc[a[k]];
            }
            const sdm_status s = skip ? SDM_OK : visit(user, p, q, shared);
            if (s) return s;
        }
    }
    return SDM_OK;
}

sdm_status sdm_fans_visit(const sdm_mesh *m, const sdm_topology *topo, const sdm_facet *facets, double tolerance,
                          sdm_arena *arena, sdm_status (*visit)(void *user, uint32_t i, uint32_t j, int shared),
                          void *user, sdm_error *err)
{
    const sdm_arena_mark before = arena->end[SDM_HIGH];
    const fan w = {m, topo, facets, tolerance / SOUND};
    bool *disc;
    sdm_status s = SDM_TAKE(arena, SDM_HIGH, &disc, m->n_vert, "vertices", err);
    if (s) return s;
    for (uint32_t v = 0; v < m->n_vert; v++) disc[v] = is_disc(&w, v);
    for (uint32_t v = 0; v < m->n_vert && !s; v++)
        if (!disc[v]) s = visit_pairs(&w, disc, v, visit, user);
    sdm_arena_release(arena, SDM_HIGH, before);
    return s;
}
