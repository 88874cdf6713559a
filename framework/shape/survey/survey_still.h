/* Finds parameters that move vertices, but no part of the surface. */
#pragma once

#include "sdm/internal/shape_survey.h"
#include "shape_family.h"

/* Sets s->still from the first shape and a few samples, for the parameters whose speed in s is
 * above 0; size: of the shapes, mm. Where a mesh cannot be made, no parameter is still. Errors as
 * sdm_exact_create(), but of the memory and of opts->cancelled alone. */
sdm_status sdm_survey_find_still(const shape_family *f, const sdm_exact_opts *opts, double size,
                                 sdm_shape_survey *s, sdm_error *err);
