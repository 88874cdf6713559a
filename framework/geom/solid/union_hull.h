/* The union hull of a closed mesh: the boundary of its solid as a mesh. Surface inside the solid is
 * removed by clipping. */
#pragma once

#include "survey.h"

/* *out = the parts of the closed mesh m with winding number <= 0 just outside and >= 1 just inside.
 * (*source)[out->n_tri]: triangle t of *out is triangle (*source)[t] of m or a part of it; the
 * array has room for out->cap_tri elements. *changed = true if some surface was removed; otherwise
 * *out and *source are not valid. *error_mm = bound, mm, on the distance between *out and the true
 * boundary. *out and *source are zero-initialised; the caller frees them, also after an error.
 * Their bytes (of the capacities) stay charged to the arena; scratch memory from its high end is
 * released. SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_union_hull(const sdm_mesh *m, const sdm_survey *survey, sdm_arena *arena,
                          sdm_mesh *out, uint32_t **source, bool *changed, double *error_mm,
                          sdm_error *err);
