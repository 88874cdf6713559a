/* Survey of a mesh: the audit and the data structures built for it, which the later steps reuse. */
#pragma once

#include "contact.h"
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

/* Fills *survey, which is zero-initialised. All its arrays are in the arena: the tree at the low
 * end, the others at the high end. Errors as sdm_mesh_audit(), also SDM_E_CANCELLED and, beyond
 * the memory limit of the arena, SDM_E_NOMEM. */
sdm_status sdm_survey_build(const sdm_mesh *m, sdm_arena *arena, sdm_survey *survey,
                            sdm_error *err);

/* Releases the facets and contacts and, unless keep_topology, the topology; the audit and the tree
 * stay. Arrays taken from the arena's high end after the survey are released as well. */
void sdm_survey_shrink(sdm_survey *survey, sdm_arena *arena, bool keep_topology);
