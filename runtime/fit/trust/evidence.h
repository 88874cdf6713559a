/* Figures that tell whether the image shows the shape at all. */
#pragma once

#include "fit/solver/problem.h"

/* *log_likelihood: log-likelihood of the sample values without a shape, under a mixture of the
   fit's tissues whose weights, means and deviations are estimated anew. The weights are the same
   for every sample, except that the tissue field divides the total weight of the outside tissues
   among them at each sample. Images only. */
sdm_status sdm_fit_shapeless_log_likelihood(const fit_problem *p, double *log_likelihood,
                                            sdm_error *err);

/* Share (0 .. 1) of the volume of the shape at problem->state that lies on voxels of the image that
 * are not NaN. 1 for points. */
double sdm_fit_inside_share(const fit_problem *p);
