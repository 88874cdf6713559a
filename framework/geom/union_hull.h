/* The boundary of what a closed mesh encloses, as a mesh: surface inside the solid is removed by exact clipping. */
#ifndef SDM_GEOM_UNION_HULL_H
#define SDM_GEOM_UNION_HULL_H

#include "survey.h"

/* Keeps the parts of a closed mesh with winding number <= 0 outside and >= 1 inside. *changed: something was removed, else *out is
   a copy. *error_mm: bound on the distance by which *out may differ from the true boundary. *out is zero-initialised. */
sdm_status sdm_union_hull(const sdm_mesh *m, const sdm_survey *s, sdm_mesh *out, bool *changed, double *error_mm,
                          sdm_error *err);

#endif
