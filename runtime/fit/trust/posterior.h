/* Uncertainty of a fit: the covariance of the estimate, and the weights of the priors. */
#pragma once

#include "fit/solver/problem.h"

/* A parameter or a measure is not determined by the data if its standard deviation exceeds this
   share of the one before the fit. */
#define FIT_BY_PRIOR 0.9

/* Fills covariance, sd, correlation, noise_factor and model_error_mm of *out, whose arrays must be
   allocated. The problem is as before, but for its counts of maps. SDM_E_QUALITY: the information
   is singular; the matrices then keep their values. */
sdm_status sdm_fit_posterior(fit_problem *p, sdm_fit_result *out, sdm_error *err);

/* After sdm_fit_posterior() and all that widens standard deviations: if the error of the network
   was measured, sets network_error and its companions of *out to the parameter that it moves most,
   of those that the data determine but for this error. */
void sdm_fit_network_error_find(const fit_problem *p, sdm_fit_result *out);

/* Error (mm, rms) near the surface of the maps of the fit: of the network, measured on its held-out
   data; 0 for exact maps. */
double sdm_fit_network_error(const fit_problem *p);

/* weight[n_unknowns]: factor of each log prior. The log-likelihood counts correlated samples as
   independent, so it is too sharp relative to a prior. To restore the balance, the log prior of
   each unknown is multiplied by the ratio of the sandwich variance to the variance for independent
   samples, at least 1 (magnitude adjustment, Pauli, Racugno and Ventura 2011); where the
   information is singular, by the noise factor. *noise_factor: a rough estimate of
   sdm_fit_result.noise_factor, at least 1. */
sdm_status sdm_fit_weigh_priors(const fit_problem *p, double *weight, double *noise_factor,
                                sdm_error *err);
