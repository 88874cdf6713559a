/* Test of parameters that were kept: would the data move them? */
#pragma once

#include "fit/solver/problem.h"

/* Frees the parameters of sdm_fit_opts.kept, goes on to the nearest maximum of the posterior, and
   adds a finding to the verdict where the data move them. The state of *p is afterwards as before,
   but its last steps are those of the free parameters. SDM_E_QUALITY: the data move the surface;
   SDM_E_NOMEM; SDM_E_CANCELLED. */
sdm_status sdm_fit_judge_kept_params(fit_problem *p, sdm_fit_result *r, sdm_error *err);
