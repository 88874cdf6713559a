/* Offset: by how much the surface of the data lies outside of the fitted one everywhere, as where
   a wall has another thickness than the shape says, which no parameter can explain. */
#pragma once

#include "fit/solver/problem.h"

/* Labels and points: adds the check SDM_FIT_CHECK_OFFSET to the verdict, unless the unknowns of the
   fit could explain an offset, or the samples lie in too few places to tell it. SDM_E_NOMEM. */
sdm_status sdm_fit_check_offset(const fit_problem *p, sdm_fit_verdict *v, sdm_error *err);
