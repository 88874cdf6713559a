/* What is found out about a mesh before it is used: the audit and the structures it was made with. */
#ifndef SDM_GEOM_SURVEY_H
#define SDM_GEOM_SURVEY_H

#include "bvh.h"
#include "contact.h"
#include "point_triangle.h"
#include "topology.h"

typedef struct sdm_survey {
    sdm_audit audit;
    sdm_topology topo;
    sdm_bvh tree;
    sdm_frame *frames; /* [n_tri] */
    sdm_contacts contacts;
} sdm_survey;

/* *s is zero-initialised; sdm_survey_dispose() frees it, also after an error. Errors as sdm_mesh_audit(). */
sdm_status sdm_survey_build(const sdm_mesh *m, sdm_survey *s, sdm_error *err);
void sdm_survey_dispose(sdm_survey *s);

#endif
