/* Parameters that move the shape as a change of its pose does: the first joint of an arm on a round
 * base turns the whole arm. The data then determine neither the parameter nor this part of the
 * pose, but only both together. */
#pragma once

#include "fit/solver/problem.h"

/* Fills problem->pose_param[problem->n_pose_params] for the evaluated state. A parameter whose
   derivative the pose explains nearly is changed by a tenth of its range, and the pose is fitted to
   the earlier surface: the parameter counts where the surface then lies where it was, to a
   twentieth of a voxel of the map. It does not count where a change four times as large leaves
   about four times the motion, as the derivatives have it: a small part of the surface then shows
   the parameter. Leaves *p evaluated. None where parameters or pose are kept.
   SDM_E_CANCELLED, SDM_E_NOMEM and errors of the maps. */
sdm_status sdm_fit_pose_params_find(fit_problem *p, sdm_error *err);

/* Adds to the covariance c[n_params + 6][n_params + 6] the variance that these parameters and the
   pose have before the fit along their common directions. */
void sdm_fit_pose_params_spread(const fit_problem *p, double *c);
