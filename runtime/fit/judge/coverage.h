/* Whether points and the fitted surface lie where the other one is: points that form a surface
   which the shape does not have, and parts of its surface without points. */
#pragma once

#include "suffice.h"

/* Adds the findings "patch" and "covered" of a fit to points, whose covariance *r holds. coarse:
   whether the voxels of its maps are too coarse, and why, see suffice.h. SDM_E_NOMEM. */
sdm_status sdm_fit_check_coverage(const fit_problem *p, const sdm_fit_result *r,
                                  fit_coarseness coarse, sdm_fit_verdict *v, sdm_error *err);
