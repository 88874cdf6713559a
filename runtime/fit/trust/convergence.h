/* Whether the iterations of a fit have converged, measured in standard deviations. */
#pragma once

#include "fit/solver/problem.h"

/* Sets r->converged and r->reason of a fit whose last steps move no unknown by more than a tenth of
   its standard deviation: kinks of exact distances may keep them larger than sdm_fit_opts.eps.
   Needs r->sd. */
void sdm_fit_accept_small_steps(const fit_problem *p, sdm_fit_result *r);

/* After the verdict: the text of a finding that the fit has not converged names the unknown that
   still moves most; so does *err (may be NULL) where it holds this text. */
void sdm_fit_name_restless(const fit_problem *p, sdm_fit_result *r, sdm_error *err);
