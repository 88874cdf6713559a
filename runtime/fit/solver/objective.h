/* The objective that a fit maximises: log-likelihood + log prior. */
#pragma once

#include "problem.h"

/* Sd (mm) of the Gaussian that blurs the map at problem->state: for shares the point spread; for
 * labels the sd of the logistic prior; for points 0. */
double sdm_fit_field_blur(const fit_problem *p);

/* Brings maps, observation model, samples and information up to date with problem->state. A map is
   made only where the parameters have changed. SDM_E_CANCELLED and errors of the maps. */
sdm_status sdm_fit_evaluate(fit_problem *p, sdm_error *err);

/* Log-posterior density at problem->state, up to a constant, after sdm_fit_evaluate(). */
double sdm_fit_objective(const fit_problem *p);

/* *log_likelihood: the log-likelihood, without the prior, at problem->state with its parameters
   replaced by params[n_params]. Overwrites problem->maps, which the next sdm_fit_evaluate() makes
   anew; samples and information stay. */
sdm_status sdm_fit_log_likelihood(fit_problem *p, const double *params, double *log_likelihood,
                                  sdm_error *err);

/* Log-likelihood of every n-th sample, so that at most `most` are used, with the latest map at the
   pose of `state`, after sdm_fit_evaluate() or sdm_fit_log_likelihood(). */
double sdm_fit_likelihood_at(const fit_problem *p, const fit_state *state, size_t most);
