/* Whether the vertices of a family of shapes are in mm. */
#pragma once

#include "sdm/internal/shape_survey.h"
#include "shape_family.h"

/* Sets s->scale from the box of s and from meshes beside the first shape. A mesh that cannot be
 * made leaves the speed unknown. SDM_E_NOMEM. */
sdm_status sdm_survey_measure_scale(const shape_family *f, sdm_shape_survey *s, sdm_error *err);
