/* Parts that meet on the surface of the union. */
#pragma once

#include "sdm/internal/part_audit.h"
#include "survey.h"

/* Sets part[i].meets_outside and meets_partly, i < n, of a closed mesh, whose survey it is.
 * part_of[triangle]: number of the part, or SDM_NO_PART. stop: NULL, or its `cancelled` counts.
 * SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_part_meetings(const sdm_mesh *m, const sdm_survey *survey, const uint32_t *part_of,
                             const sdm_exact_opts *stop, sdm_part *part, size_t n, sdm_error *err);
