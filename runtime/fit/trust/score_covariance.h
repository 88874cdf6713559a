/* Covariance of the score (the gradient of the log-likelihood) when neighbouring residuals are
 * correlated. */
#pragma once

#include "fit/solver/problem.h"

/* Matrices [n_unknowns][n_unknowns]. */
typedef struct fit_score_covariance {
    /* caused by the noise of the samples; label maps: and by their steps (label_steps.h) */
    double *noise;
    /* caused by a map error of 1 mm (rms); multiply by the squared error in mm */
    double *model;
    /* sum of the correlations of a residual with all others, itself included; not corrected for the
     * fit */
    double noise_factor;
} fit_score_covariance;

/* Computes both matrices and the noise factor at problem->state from its samples; on error *out is
   empty. model_mm: edge (mm) of the cubes within which the error of a network's map is constant; 0:
   model stays 0. influence[N][N]: inverse of the information, 0 for unknowns that were kept. With
   it the correlations are corrected for the part of the noise that the fit has explained, and
   `noise` is made positive definite by a narrower window of lags where necessary. NULL: a cheap,
   rough estimate of `noise`. */
sdm_status sdm_fit_score_covariance_create(const fit_problem *p, double model_mm,
                                           const double *influence, fit_score_covariance *out,
                                           sdm_error *err);
void sdm_fit_score_covariance_dispose(fit_score_covariance *s);
