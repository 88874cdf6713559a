/* What is found out about a mesh before it is used: the audit and the structures it was made with.
 */
#ifndef SDM_GEOM_SURVEY_H
#define SDM_GEOM_SURVEY_H

#include "contact.h"
#include "memory/budget.h"
#include "mesh/bvh.h"
#include "mesh/facet.h"
#include "mesh/topology.h"

typedef struct sdm_survey {
    sdm_audit audit;
    sdm_topology topo;
    sdm_bvh tree;
    sdm_facet *facets; /* [n_tri] */
    sdm_contacts contacts;
    sdm_arena_mark start, with_topology; /* the arena's high end before and after the topology */
} sdm_survey;

/* *s is zero-initialised; all of it is in the arena: the tree at the low end, the rest at the high
   end. budget may be NULL. Errors as sdm_mesh_audit(). */
sdm_status sdm_survey_build(const sdm_mesh *m, sdm_arena *arena, sdm_survey *s, sdm_budget *budget,
                            sdm_error *err);
/* What a survey takes on closed meshes with a few contacts. */
size_t sdm_survey_usual_bytes(const sdm_mesh *m);
/* Releases what is not asked for any more once the surface is made; the audit and the tree stay,
 * the topology on demand. */
void sdm_survey_shrink(sdm_survey *s, sdm_arena *arena, bool keep_topology);

#endif
