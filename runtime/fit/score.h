/* Covariance of the score: how much the gradient of the log-likelihood scatters when neighbouring residuals are correlated. */
#ifndef FIT_SCORE_H
#define FIT_SCORE_H

#include "newton.h"

typedef struct fit_scatter {
    double *noise; // [n_unknowns][n_unknowns] of the residuals
    double *model; // [n_unknowns][n_unknowns] of an error of 1 mm of the map, correlated over fit_scatter.model_mm
    double noise_factor; // sum of the correlations of a residual with all others
} fit_scatter;

/* At problem->state, from its sites. model_mm: distance over which the error of a network's map is alike. */
sdm_status sdm_fit_scatter_create(const fit_problem *p, double model_mm, fit_scatter *out, sdm_error *err);
void sdm_fit_scatter_dispose(fit_scatter *s);

#endif
