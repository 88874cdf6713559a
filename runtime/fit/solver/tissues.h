/* Re-estimation of the tissues: weights, sd and (labels) means, and the sd of points, which
 * Newton's steps leave as they are. */
#ifndef FIT_LOOK_H
#define FIT_LOOK_H

#include "newton.h"

enum { FIT_LOOK_MAX = 3 * FIT_TISSUES_MAX };

/* What is estimated, as numbers of any size and of about the same scale; x[FIT_LOOK_MAX]. Returns
 * how many. */
size_t sdm_fit_look_numbers(const fit_problem *p, double *x);

/* The estimates of problem->state from such numbers. */
void sdm_fit_look_set(fit_problem *p, const double *x);

/* Tissues that hold less than one independent value, or fewer than ten values, are absent from now
 * on: they have the laws of the start, which stay. */
void sdm_fit_look_settle(fit_problem *p);

/* One step of the estimation in problem->state, and laws and sums with it. */
sdm_status sdm_fit_look_update(fit_problem *p, sdm_error *err);

#endif
