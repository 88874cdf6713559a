/* Closed parts of a mesh that are inside out. */
#ifndef SDM_GEOM_PARTS_H
#define SDM_GEOM_PARTS_H

#include "survey.h"

static inline void sdm_triangle_turn(sdm_mesh *m, size_t t)
{
    const uint32_t v = m->tri[3 * t + 1];
    m->tri[3 * t + 1] = m->tri[3 * t + 2];
    m->tri[3 * t + 2] = v;
}

/* Turns the triangles of parts (components by edges) of the closed mesh m on which the winding
   number is below 0: no solid has such a place. A cavity in a solid is none, and parts that meet
   others are left as they are: there is no telling which is wrong. *n_turned: how many; when it is
   not 0 the survey of m no longer holds. */
sdm_status sdm_parts_turn(sdm_mesh *m, const sdm_survey *s, size_t *n_turned, sdm_error *err);

#endif
