/* Test of a pose that was kept: would the data move it? */
#pragma once

#include "fit/solver/problem.h"

/* Frees the pose, goes on to the nearest maximum of the posterior, and adds a finding to the
   verdict where the data move the pose. Sets kept_pose_gain and kept_pose_motion of *r; NaN where
   the free pose cannot be fitted. *p must be evaluated; it keeps the state of the free pose and its
   steps, so take over the result from it before. SDM_E_QUALITY: the data move the pose;
   SDM_E_NOMEM; SDM_E_CANCELLED. */
sdm_status sdm_fit_judge_kept_pose(fit_problem *p, sdm_fit_result *r, sdm_error *err);
