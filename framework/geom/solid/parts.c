/* Finds and turns the parts of a closed mesh that are inside out, by one ray per part. */
#include "parts.h"

#include <stdbool.h>

#include "mesh/crossings.h"
#include "sdm/memory.h"

/* A part; stored at the index of its root triangle. */
typedef struct part {
    uint32_t widest; /* the part's triangle with the largest area */
    bool meets;      /* the part has contacts with another part */
    bool turn;       /* the part is inside out */
} part;

sdm_status sdm_parts_turn(sdm_mesh *m, const sdm_survey *survey, size_t *n_turned, sdm_error *err)
{
    *n_turned = 0;
    if (!survey->audit.closed || survey->audit.components < 2) return SDM_OK;
    const sdm_facet *facets = survey->facets;
    const sdm_contacts *contacts = &survey->contacts;
    uint32_t *root = NULL;
    part *parts = NULL;
    sdm_status s = SDM_ALLOC(&root, m->n_tri, "parts", err);
    if (!s) s = SDM_ALLOC(&parts, m->n_tri, "parts", err);
    if (!s) {
        // the widest triangle of each part, and whether the part meets another part
        sdm_topology_parts(&survey->topo, root);
        for (uint32_t t = 0; t < m->n_tri; t++) root[t] = sdm_forest_root(root, t);
        for (uint32_t t = 0; t < m->n_tri; t++) parts[t].widest = t;
        for (uint32_t t = 0; t < m->n_tri; t++) {
            part *p = &parts[root[t]];
            const sdm_facet *f = &facets[t], *best = &facets[p->widest];
            if (f->longest * f->height > best->longest * best->height) p->widest = t;
            for (uint32_t c = contacts->first[t]; c < contacts->first[t + 1]; c++)
                if (root[contacts->list[c].other] != root[t]) p->meets = true;
        }
        // for parts that meet no other: the winding number just outside the widest triangle
        for (uint32_t t = 0; t < m->n_tri; t++) {
            part *p = &parts[t];
            if (root[t] != t || p->meets || !(facets[p->widest].height > contacts->tolerance))
                continue;
            double x[3];
            sdm_facet_centre(m, p->widest, x);
            p->turn =
                sdm_ray_winding_along(m, &survey->tree, x, facets[p->widest].n, &p->widest, 1) < 0;
            *n_turned += p->turn;
        }
        for (size_t t = 0; t < m->n_tri && *n_turned; t++)
            if (parts[root[t]].turn) sdm_triangle_turn(m, t);
    }
    sdm_free(root);
    sdm_free(parts);
    return s;
}

/* Replaces a survey by a new one. low, high: state of the arena's ends before the old survey, whose
 * memory is released first. */
static sdm_status survey_again(sdm_mesh *m, sdm_arena *arena, sdm_arena_mark low,
                               sdm_arena_mark high, sdm_survey *survey, sdm_error *err)
{
    sdm_arena_release(arena, SDM_LOW, low);
    sdm_arena_release(arena, SDM_HIGH, high);
    *survey = (sdm_survey){0};
    return sdm_survey_build(m, arena, survey, err);
}

sdm_status sdm_parts_survey(sdm_mesh *m, sdm_arena *arena, sdm_survey *survey, sdm_audit *given,
                            bool *turned, size_t *n_turned, sdm_error *err)
{
    const sdm_arena_mark low = arena->end[SDM_LOW], high = arena->end[SDM_HIGH];
    sdm_status s = sdm_survey_build(m, arena, survey, err);
    if (s) return s;
    *given = survey->audit;
    *turned = survey->audit.inverted;
    if (*turned) {
        for (size_t t = 0; t < m->n_tri; t++) sdm_triangle_turn(m, t);
        s = survey_again(m, arena, low, high, survey, err);
        if (s) return s;
    }
    s = sdm_parts_turn(m, survey, n_turned, err);
    return s || !*n_turned ? s : survey_again(m, arena, low, high, survey, err);
}
