/* Test of parameters that were kept: would the data move them? */
#pragma once

#include "fit/solver/problem.h"

/* Frees the parameters of sdm_fit_opts.kept, goes on to the highest maximum of the posterior that
   it finds, and adds a finding to the verdict that names where they go. The state of *p is
   afterwards as before, but its last steps are those of the free parameters, and its samples may be
   those of the search. SDM_E_QUALITY: the data move the surface;
   SDM_E_NOMEM; SDM_E_CANCELLED. */
sdm_status sdm_fit_judge_kept_params(fit_problem *p, sdm_fit_result *r, sdm_error *err);
