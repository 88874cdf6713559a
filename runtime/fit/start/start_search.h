/* Search for the start of a fit: which rotation of the start pose leads to the best fit. */
#pragma once

#include "fit/solver/problem.h"

/* Replaces problem->state by a better start. One start (no turns, or the pose is kept): some
   iterations with a wide point spread. Several turns, R = R_start Q with the pivot kept in place:
   some iterations from each with a wide point spread; the best few distinct ones continue with more
   samples, first with the wide point spread, then with the given one; the objective decides.

   Parameters and pose move unless the options keep them; point spread, l_ref, point_sd and
   appearance end at their start values. *turn: number of the chosen turn, 0 without turns.
   problem->prior becomes the start pose with this turn. Samples come from a ball that holds every
   turn of the shape. SDM_E_ARG: no sample in it. The next best of several turns becomes
   problem->runner_up. */
sdm_status sdm_fit_start_search(fit_problem *p, size_t *turn, sdm_error *err);

/* Chooses samples from a ball that holds the shape at problem->state in every turn, with a stride
   that leaves about `wanted` of them. */
sdm_status sdm_fit_samples_near(fit_problem *p, double wanted, sdm_error *err);

/* Widens the point spread of *state, or the deviation of points, so that a shape finds its surface
   from a distance: three times the given width, at most 0.12 of the reach of the shape, and not
   less than the given one. */
void sdm_fit_start_widen(const fit_problem *problem, fit_state *state);

/* Iterations from problem->state, which has a wide point spread; then the widths of `given` again,
   with `sharp` further iterations. Keeps what the options keep, and the appearance. Errors of
   sdm_fit_newton(). */
sdm_status sdm_fit_start_continue(fit_problem *problem, const fit_state *given, bool sharp,
                                  sdm_error *err);
