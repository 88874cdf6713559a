/* Which closed parts of a mesh are inside out: one ray each. */
#include "parts.h"

#include <math.h>
#include <stdbool.h>

#include "crossings.h"
#include "sdm/memory.h"

/* What is known of the part whose root is a triangle. */
typedef struct part {
    uint32_t widest; /* triangle with the largest area */
    bool meets;      /* another part */
    bool turn;
} part;

/* root[t]: one triangle of t's part. */
static void find_parts(const sdm_topology *topo, uint32_t *root)
{
    for (size_t t = 0; t < topo->n_tri; t++) root[t] = (uint32_t)t;
    for (size_t i = 0; i < topo->n_edges; i++)
        for (uint32_t h = topo->edges[i].first; topo->next[h] != SDM_NONE; h = topo->next[h])
            sdm_forest_join(root, h / 3, topo->next[h] / 3);
    for (size_t t = 0; t < topo->n_tri; t++) root[t] = sdm_forest_root(root, (uint32_t)t);
}

/* Winding number in front of triangle t, on the side its normal points to. */
static int number_before(const sdm_mesh *m, const sdm_survey *s, uint32_t t)
{
    const uint32_t *v = &m->tri[3 * (size_t)t];
    const double *n = s->facets[t].n;
    double x[3];
    int axis = 0;
    for (size_t i = 0; i < 3; i++) {
        x[i] = (m->vert[3 * (size_t)v[0] + i] + m->vert[3 * (size_t)v[1] + i] + m->vert[3 * (size_t)v[2] + i]) / 3;
        if (fabs(n[i]) > fabs(n[axis])) axis = (int)i;
    }
    return sdm_ray_winding(m, &s->tree, x, axis, n[axis] > 0 ? 1 : -1, &t, 1);
}

sdm_status sdm_parts_turn(sdm_mesh *m, const sdm_survey *s, size_t *n_turned, sdm_error *err)
{
    *n_turned = 0;
    if (!s->audit.closed || s->audit.components < 2) return SDM_OK;
    uint32_t *root = NULL;
    part *parts = NULL;
    sdm_status st = SDM_ALLOC(&root, m->n_tri, "parts", err);
    if (!st) st = SDM_ALLOC(&parts, m->n_tri, "parts", err);
    if (!st) {
        find_parts(&s->topo, root);
        for (uint32_t t = 0; t < m->n_tri; t++) parts[t].widest = t;
        for (uint32_t t = 0; t < m->n_tri; t++) {
            part *p = &parts[root[t]];
            const sdm_facet *f = &s->facets[t], *best = &s->facets[p->widest];
            if (f->longest * f->height > best->longest * best->height) p->widest = t;
            for (uint32_t c = s->contacts.first[t]; c < s->contacts.first[t + 1]; c++)
                if (root[s->contacts.list[c].other] != root[t]) p->meets = true;
        }
        for (uint32_t t = 0; t < m->n_tri; t++) {
            part *p = &parts[t];
            if (root[t] != t || p->meets || !(s->facets[p->widest].height > s->contacts.tolerance)) continue;
            p->turn = number_before(m, s, p->widest) < 0;
            *n_turned += p->turn;
        }
        for (size_t t = 0; t < m->n_tri && *n_turned; t++)
            if (parts[root[t]].turn) sdm_triangle_turn(m, t);
    }
    sdm_free(root);
    sdm_free(parts);
    return st;
}
