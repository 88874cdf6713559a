/* The verdict: whether a fit is to be trusted, with reasons. */
#pragma once

#include "fit/solver/problem.h"

/* Makes all checks of a finished fit, whose figures *r holds already, and fills r->verdict.
   SDM_E_QUALITY with the text of the first finding that failed. */
sdm_status sdm_fit_judge(const fit_problem *p, sdm_fit_result *r, sdm_error *err);
