/* Test of a pose that was kept: would the data move it? */
#pragma once

#include "fit/solver/problem.h"

/* Frees the pose, goes on to the nearest maximum of the posterior, and returns to the state from
   which it came, evaluated. *gain: gain in log posterior density, as of independent samples;
   *motion: rms motion of the surface along its normal by the change of the pose, mm. */
sdm_status sdm_fit_kept_pose_test(fit_problem *p, double *gain, double *motion, sdm_error *err);
