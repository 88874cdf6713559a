/* The posterior at the maximum: covariance, and what it stands on. */
#ifndef FIT_POSTERIOR_H
#define FIT_POSTERIOR_H

#include "fit/solver/newton.h"

/* Fills covariance, sd, correlation, noise_factor and model_error_mm of *out, whose arrays are
 * there. */
sdm_status sdm_fit_posterior(const fit_problem *p, sdm_fit_result *out, sdm_error *err);

/* weight[n_params + 6] of the log prior of each unknown beside a log-likelihood that counts
   correlated values as independent: its variance as the residuals scatter over that as if they were
   independent, at least 1 (the magnitude adjustment of Pauli, Racugno and Ventura 2011, along each
   unknown). *noise_factor: as in sdm_fit_result. */
sdm_status sdm_fit_weigh_priors(const fit_problem *p, double *weight, double *noise_factor,
                                sdm_error *err);

#endif
