/* Whether the vertices of a family of shapes are in mm. */
#pragma once

#include "sdm/internal/shape_survey.h"
#include "shape_family.h"

/* Is parameter k in mm? */
bool sdm_survey_is_length(const sdm_instance *shape, size_t k);

/* Sets s->scale from the box of s and from meshes beside the first shape. A mesh that cannot be
 * made leaves the speed unknown. SDM_E_NOMEM. */
sdm_status sdm_survey_measure_scale(const shape_family *f, sdm_shape_survey *s, sdm_error *err);

/* Sets the causes s->unit of the parameters that are slow, or whose speed is odd. SDM_E_NOMEM. */
sdm_status sdm_survey_find_units(const shape_family *f, sdm_shape_survey *s, sdm_error *err);

/* Looks for lengths that move one part as a length in mm does, and another one as a length in m:
 * sdm_survey_unit.mixed. SDM_E_NOMEM. */
sdm_status sdm_survey_find_mixed(const shape_family *f, sdm_shape_survey *s, sdm_error *err);
