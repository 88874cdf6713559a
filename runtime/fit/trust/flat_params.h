/* Parameters about which points say less than the covariance has it: the surface that they move has
 * no points, or points at its edge alone. */
#pragma once

#include "fit/solver/problem.h"

/* After sdm_fit_posterior(), points: measures the likelihood at six standard deviations from each
   parameter that the data determine, and over the whole range where it is flatter there than the
   covariance has it, or where the parameter is known to no better than a twentieth of its deviation
   before the fit. Widens the standard deviation where a value is more likely than the normal
   distribution has it, at most to the deviation before the fit; where a parameter hangs on three
   points or fewer, also the deviations of the unknowns that follow it. Leaves *p evaluated. Does
   nothing where the options keep all parameters. SDM_E_CANCELLED, SDM_E_NOMEM. */
sdm_status sdm_fit_flat_params_spread(fit_problem *p, sdm_fit_result *out, sdm_error *err);
