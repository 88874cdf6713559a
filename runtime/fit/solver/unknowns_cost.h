/* How much the unknowns of a shape cost its evidence. */
#pragma once

#include "problem.h"

/* The logarithm by which the likelihood of the best values exceeds its mean over all values of the
   unknowns that were likely before the fit. r: with its covariance; n_independent: the number of
   independent samples.
   Pose: it has no prior; each of its six unknowns costs log(n_independent) / 2 (Schwarz 1978).
   Parameters: Laplace's method with their priors (Kass and Raftery 1995), so that a parameter which
   the data do not determine costs nothing; at most as much as an unknown of the pose. */
double sdm_fit_unknowns_cost(const fit_problem *p, const sdm_fit_result *r, double n_independent);
