/* Whether the image shows the shape at all. */
#ifndef FIT_EVIDENCE_H
#define FIT_EVIDENCE_H

#include "fit/solver/newton.h"

/* Log-likelihood of the values at the sites by a mixture of the same tissues that knows no shape,
 * its laws estimated. */
sdm_status sdm_fit_without_shape(const fit_problem *p, double *log_likelihood, sdm_error *err);

/* Share of the volume of the shape at problem->state that lies in the image, on voxels that are not
 * NaN. */
double sdm_fit_inside_share(const fit_problem *p);

#endif
