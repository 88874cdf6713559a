/* Turns parts (components connected by edges) of a closed mesh that are inside out. */
#pragma once

#include "survey.h"

/* Reverses the orientation of triangle t. */
static inline void sdm_triangle_turn(sdm_mesh *m, size_t t)
{
    const uint32_t v = m->tri[3 * t + 1];
    m->tri[3 * t + 1] = m->tri[3 * t + 2];
    m->tri[3 * t + 2] = v;
}

/* Turns (reverses) each part of the closed mesh m that has a winding number < 0 just outside of its
 * widest triangle; such points do not occur at the boundary of a solid. The surface of a cavity in
 * a solid has a winding number >= 0 just outside and is not turned. Parts with contacts to other
 * parts are not turned either, because it is undecidable which of them is wrong. A mesh that is not
 * closed is left as it is. *n_turned: number of turned parts; if it is not 0, the survey of m is
 * out of date. SDM_E_NOMEM. */
sdm_status sdm_parts_turn(sdm_mesh *m, const sdm_survey *survey, size_t *n_turned, sdm_error *err);

/* Surveys the mesh m and corrects its orientation: all of it if its volume is negative, then parts
 * as sdm_parts_turn() does. *survey, whose memory comes from the arena, belongs to the corrected
 * mesh; *given = the audit before the correction; *turned: the whole mesh was turned. Errors as
 * sdm_survey_build(). */
sdm_status sdm_parts_survey(sdm_mesh *m, sdm_arena *arena, sdm_survey *survey, sdm_audit *given,
                            bool *turned, size_t *n_turned, sdm_error *err);
