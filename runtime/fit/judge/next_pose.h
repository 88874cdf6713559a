/* Compares the fit with the shape in its next best pose: the runner-up of the search for the start,
   and the best of 101 rotations of the fitted shape, 29 about its principal axes and 72 spread
   evenly. If the shape explains the data as well in another pose, they do not determine its pose.
   The same with another value of one parameter, such as a joint of an arm: the best of three
   values, spread evenly over the range, of the two parameters for which it explains the data best.
   Points of a part of the surface: further turns, with other parameters, see
   sdm_fit_turned_starts(). */
#pragma once

#include "fit/solver/problem.h"

/* Adds the finding "next pose" to the verdict of *r, if it has not failed. Some iterations lead
   from each rival start to the nearest maximum; fit and rival are compared on voxels of the ball
   that holds both, with the tissues of each. A rival whose surface is nearly that of the fit is
   none, nor is one that is as good and differs along open directions alone. No finding where the
   pose is kept or where no rival remains, as for a ball of given size. factor: how many correlated
   voxels of an image count as one independent one. *p is left at a rival, with samples from that
   ball; points: p->better is the rival, where it explains them better. SDM_E_QUALITY: the finding
   failed; SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_fit_judge_next_pose(fit_problem *p, double factor, sdm_fit_result *r,
                                   sdm_error *err);

/* After a fit from the better rival that lost: the finding "next pose" no longer advises to start
   there. */
void sdm_fit_next_pose_tried(sdm_fit_verdict *v);
