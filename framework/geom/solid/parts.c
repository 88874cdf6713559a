/* Which closed parts of a mesh are inside out: one ray each. */
#include "parts.h"

#include <stdbool.h>

#include "mesh/crossings.h"
#include "sdm/memory.h"

/* What is known of the part whose root is a triangle. */
typedef struct part {
    uint32_t widest; /* triangle with the largest area */
    bool meets;      /* another part */
    bool turn;
} part;

sdm_status sdm_parts_turn(sdm_mesh *m, const sdm_survey *s, size_t *n_turned, sdm_error *err)
{
    *n_turned = 0;
    if (!s->audit.closed || s->audit.components < 2) return SDM_OK;
    uint32_t *root = NULL;
    part *parts = NULL;
    sdm_status st = SDM_ALLOC(&root, m->n_tri, "parts", err);
    if (!st) st = SDM_ALLOC(&parts, m->n_tri, "parts", err);
    if (!st) {
        sdm_topology_parts(&s->topo, root);
        for (uint32_t t = 0; t < m->n_tri; t++) root[t] = sdm_forest_root(root, t);
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
            if (root[t] != t || p->meets || !(s->facets[p->widest].height > s->contacts.tolerance))
                continue;
            double x[3];
            sdm_facet_centre(m, p->widest, x);
            p->turn =
                sdm_ray_winding_along(m, &s->tree, x, s->facets[p->widest].n, &p->widest, 1) < 0;
            *n_turned += p->turn;
        }
        for (size_t t = 0; t < m->n_tri && *n_turned; t++)
            if (parts[root[t]].turn) sdm_triangle_turn(m, t);
    }
    sdm_free(root);
    sdm_free(parts);
    return st;
}
