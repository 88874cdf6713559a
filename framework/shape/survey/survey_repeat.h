/* Does a shape give the same meshes when they are made again, by one thread and by several? */
#pragma once

#include "shape_family.h"

/* Repeats some of the meshes at p[n][n_params], fewer if they are large; brief: fewer, and
 * threads for a tenth of a second. *out: the first cause found, cause UNKNOWN and unlike 0 if there
 * is none. Several threads at once are tested unless the shape is isolated, where each has a
 * process. A call that ends the worker of an isolated shape is left to the meshes of the survey.
 * SDM_E_NOMEM. */
sdm_status sdm_survey_repeat(const sdm_instance *shape, const double *p, size_t n, bool brief,
                             sdm_repeat *out, sdm_error *err);
