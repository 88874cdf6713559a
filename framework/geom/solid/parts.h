/* Parts (components connected by edges) of a closed mesh that are inside out. */
#ifndef SDM_GEOM_PARTS_H
#define SDM_GEOM_PARTS_H

#include "survey.h"

/* Reverses the orientation of triangle t. */
static inline void sdm_triangle_turn(sdm_mesh *m, size_t t)
{
    const uint32_t v = m->tri[3 * t + 1];
    m->tri[3 * t + 1] = m->tri[3 * t + 2];
    m->tri[3 * t + 2] = v;
}

/* Turns each part of the closed mesh m with a winding number below 0 just outside of its widest
 * triangle: the boundary of a solid has no such point. The surface of a cavity in a solid has a
 * winding number of at least 0 outside and stays. Parts with contacts to other parts stay too: it
 * is undecidable which of them is wrong. *n_turned: number of turned parts; if it is not 0, the
 * survey of m is out of date. SDM_E_NOMEM. */
sdm_status sdm_parts_turn(sdm_mesh *m, const sdm_survey *survey, size_t *n_turned, sdm_error *err);

#endif
