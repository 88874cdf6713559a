/* Parameters about which points say less than the covariance has it: the part of the shape that
 * they move has no points. */
#pragma once

#include "fit/solver/problem.h"

/* After sdm_fit_posterior(), points: measures the likelihood at values over the whole range of each
   parameter that is known to no better than a twentieth of its deviation before the fit, all other
   unknowns kept, and widens its standard deviation where a value is more likely than the normal
   distribution has it, at most to the deviation before the fit. Leaves *p evaluated. Nothing where
   parameters are kept. SDM_E_CANCELLED, SDM_E_NOMEM. */
sdm_status sdm_fit_flat_params_spread(fit_problem *p, sdm_fit_result *out, sdm_error *err);
