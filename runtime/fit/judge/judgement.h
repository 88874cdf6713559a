/* The verdict: whether a fit is to be trusted, with reasons. */
#pragma once

#include "fit/solver/problem.h"

/* Makes the checks of a finished fit, whose figures *r holds already, at its estimate, and fills
   r->verdict. *factor: how many correlated voxels of an image count as one independent one.
   SDM_E_QUALITY with the text of the first finding that failed. */
sdm_status sdm_fit_judge(const fit_problem *p, sdm_fit_result *r, double *factor, sdm_error *err);
