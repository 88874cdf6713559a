/* Continuity of the mesh along one parameter. */
#pragma once

#include "sdm/internal/shape_survey.h"
#include "shape_family.h"

/* Follows parameter k of the shape p[n_params] over its range and reports the worst place at which
 * the mesh does not change continuously; out->shape is not set. size: of the shapes, mm; jumps
 * below 1e-5 of it are not reported. A mesh that cannot be made ends the search. [any thread] */
sdm_status sdm_survey_line(const shape_family *f, const double *p, size_t k, double size,
                           sdm_survey_jump *out, sdm_error *err);

/* Makes the meshes just below and just above `value` of parameter k again: in the other order, and
 * after the mesh of the shape other[n_params]. *same: all have the bits of the first time. p: as
 * above. [one thread] */
sdm_status sdm_survey_line_again(const shape_family *f, const double *p, size_t k,
                                 const double *other, double value, bool *same, sdm_error *err);
