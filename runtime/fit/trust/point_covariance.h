/* Covariance of the score in a fit to points, whose distances from the surface may be correlated:
 * points that sample one surface share the errors of its shape, of the map and of the mesh. */
#pragma once

#include "fit/solver/problem.h"

/* Adds to noise[N][N] and, if model_mm > 0, to model[N][N] the covariances of the score by the
 * points of *problem at its state, as in fit_score_covariance; sets *noise_factor. model_mm: edge
 * of the squares of the surface within which the error of a map is constant. rough: from fewer
 * points. The same bits for any number of threads. */
sdm_status sdm_fit_point_covariance(const fit_problem *p, double model_mm, bool rough,
                                    double *noise, double *model, double *noise_factor,
                                    sdm_error *err);
