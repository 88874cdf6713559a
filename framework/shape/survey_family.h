/* Ranges, distributions and parameter vectors of a family of shapes; searches along parameters. */
#pragma once

#include "sdm/internal/shape_survey.h"
#include "shape_internal.h"

typedef struct survey_family {
    const sdm_instance *shape;
    const sdm_survey_opts *opts;
    double range[SHAPE_PARAMS_MAX][2];
    sdm_distribution distribution[SHAPE_PARAMS_MAX];
    bool all_corners; /* the corners of the ranges are all of them, not random ones */
} survey_family;

/* Follows parameter k of the shape p[n_params] over its range and reports the worst place at which
 * the mesh does not change continuously; out->shape is not set. size: of the shapes, mm; jumps
 * below 1e-5 of it are not reported. A mesh that cannot be made ends the search. [any thread] */
sdm_status sdm_survey_line(const survey_family *f, const double *p, size_t k, double size,
                           sdm_survey_jump *out, sdm_error *err);
