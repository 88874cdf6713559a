/* Sums over all samples: log-likelihood, gradient, information matrices, moments of the tissues. */
#pragma once

#include "fit/data/samples.h"

/* Log-likelihood of all samples and its derivatives by the n_unknowns unknowns: the columns, then
   the means of the tissues. */
typedef struct fit_information {
    size_t n_unknowns;
    double log_likelihood;
    /* error of log_likelihood caused by the single precision of the maps */
    double rounding;
    /* [n_unknowns] */
    double *gradient;
    /* [n_unknowns][n_unknowns] symmetric, see fit_likelihood */
    double *complete, *observed;
    /* scratch memory: sums of each slice of the samples */
    double *parts;
} fit_information;

/* Allocates; on error *out is empty. */
sdm_status sdm_fit_information_create(size_t n_unknowns, fit_information *out, sdm_error *err);
void sdm_fit_information_dispose(fit_information *s);

/* Fills *s after sdm_fit_samples_evaluate(). The same bits for any number of threads (0: the OpenMP
   default), as the functions below. */
void sdm_fit_information_compute(fit_information *s, const fit_samples *samples,
                                 const fit_observation *obs, int n_threads);

/* Returns the log-likelihood alone, with the field of the latest maps at the pose of `state`. The
 * field values stored in the samples do not change. */
double sdm_fit_samples_log_likelihood(const fit_samples *samples, const fit_maps *maps,
                                      const fit_observation *obs, const fit_state *state);

/* Moments of the tissues over all samples, see sdm_fit_moments_add(). */
void sdm_fit_samples_moments(const fit_samples *samples, const fit_observation *obs, int n_threads,
                             fit_moments *out);
