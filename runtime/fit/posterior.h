/* The posterior at the maximum: covariance, and what it stands on. */
#ifndef FIT_POSTERIOR_H
#define FIT_POSTERIOR_H

#include "newton.h"

/* Fills covariance, sd, correlation, noise_factor and model_error_mm of *out, whose arrays are there. */
sdm_status sdm_fit_posterior(const fit_problem *p, sdm_fit_result *out, sdm_error *err);

#endif
