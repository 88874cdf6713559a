/* How much the unknowns of a shape cost its evidence. */
#pragma once

#include "fit/solver/problem.h"

/* The logarithm by which the likelihood of the best values exceeds the mean likelihood over all
   values of the unknowns that were possible before the fit. r: with its covariance;
   n_independent: the number of independent samples.
   Parameters: Laplace's method (Kass and Raftery 1995), with their priors. So a parameter that the
   data do not determine costs nothing.
   Pose: it has no prior; each of its six unknowns costs log(n_independent) / 2 (Schwarz 1978). So
   do parameters where the covariance is unknown. */
double sdm_fit_unknowns_cost(const fit_problem *p, const sdm_fit_result *r, double n_independent);
