/* The boundary of what a closed mesh encloses, as a mesh: surface inside the solid is removed by
 * exact clipping. */
#ifndef SDM_GEOM_UNION_HULL_H
#define SDM_GEOM_UNION_HULL_H

#include "survey.h"

/* Keeps the parts of a closed mesh with winding number <= 0 outside and >= 1 inside. *out and
   *source ([n_tri of out]: the triangle of m that each is a part of) are zero-initialised and the
   caller's to free, also after an error. changed: something was removed, else they are not of use.
   *error_mm: bound on the distance by which *out may differ from the true boundary. budget may be
   NULL. The arena's high end is as before. */
sdm_status sdm_union_hull(const sdm_mesh *m, const sdm_survey *s, sdm_arena *arena, sdm_mesh *out,
                          uint32_t **source, bool *changed, double *error_mm, sdm_budget *budget,
                          sdm_error *err);

#endif
