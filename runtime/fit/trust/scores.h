/* Covariance of the score: how much the gradient of the log-likelihood scatters when neighbouring
 * residuals are correlated. */
#ifndef FIT_SCORE_H
#define FIT_SCORE_H

#include "fit/solver/newton.h"

typedef struct fit_scatter {
    double *noise;       // [n_unknowns][n_unknowns] of the residuals
    double *model;       // [n_unknowns][n_unknowns] of an error of the map of 1 mm (rms)
    double noise_factor; // sum of the correlations of a residual with all others, as residuals are
} fit_scatter;

/* At problem->state, from its sites. model_mm: edge of the cubes within which the error of a
   network's map is alike; 0: no such error. influence[n_unknowns][n_unknowns]: inverse of the
   information, 0 for what was kept; with it the correlations are freed of what the fit has taken
   from the residuals, and noise is made positive definite by a narrower window where need be. NULL:
   a rough estimate of noise. */
sdm_status sdm_fit_scatter_create(const fit_problem *p, double model_mm, const double *influence,
                                  fit_scatter *out, sdm_error *err);
void sdm_fit_scatter_dispose(fit_scatter *s);

#endif
