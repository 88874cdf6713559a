/* Covariance of the score in a fit to points, whose distances from the surface may be correlated:
 * points that sample one surface share the errors of its shape, of the map and of the mesh. */
#pragma once

#include "score_covariance.h"

/* Fills *out, whose matrices are 0, from the points of *problem at its state. model_mm, rough: as
 * in sdm_fit_score_covariance_create(), rough with influence = NULL. The same bits for any number
 * of threads. */
sdm_status sdm_fit_point_covariance(const fit_problem *p, double model_mm, bool rough,
                                    fit_score_covariance *out, sdm_error *err);
