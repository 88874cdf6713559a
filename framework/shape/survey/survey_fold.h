/* Surfaces that pass through themselves between two shapes of a family. */
#pragma once

#include "shape_family.h"

typedef struct survey_fold {
    /* triangles that turn over within the same sixteenth of the way: the largest share of the area
     * of the second shape */
    double share;
    double at; /* where they turn over: 0 at the first shape, 1 at the second */
} survey_fold;

/* Follows the straight line from the shape from[n_params] to the shape to[n_params] and looks for
 * triangles whose normal turns by more than 120 degrees within a sixteenth of the way: they pass
 * through zero area, as those of an inner wall do when the wall gets thicker than the radius. size:
 * of the shapes, mm. share is 0 if a mesh cannot be made or the triangles change. [any thread] */
sdm_status sdm_survey_find_fold(const shape_family *f, const double *from, const double *to,
                                double size, survey_fold *out, sdm_error *err);
