/* The unknowns in the last iterations: what still moves, and what only swings. */
#pragma once

#include "problem.h"

/* Remembers an iteration: its step[n_params + 6] and, plain[n_params + 6], the undamped one; NULL:
   there is none, or the damping hides it. */
void sdm_fit_remember(fit_problem *p, const double *step, const double *plain);

/* How much unknown i of n_params + 6 still moves: half of the range of its values in the last
   FIT_RECENT iterations, or the mean of the undamped steps in them, if that is larger; infinite if
   there were fewer iterations, or if damping hid the steps. In the unit of the covariance. */
double sdm_fit_unrest(const fit_problem *p, size_t i);

/* How far unknown i of n_params + 6 goes to and fro about one place: half of the range of its
   values in the last FIT_RECENT iterations; 0 where most of the undamped steps in them have one
   direction, or where sdm_fit_unrest() is infinite. */
double sdm_fit_swing(const fit_problem *p, size_t i);
