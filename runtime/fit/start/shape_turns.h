/* Turns of a fitted shape about its centre, and the best of them as starts of a fit to points. */
#pragma once

#include "fit/solver/problem.h"
#include "start_list.h"

/* The turns: the rotations of a cube, those by a third and by a fifth of a turn about each of its
 * axes (fins, petals), and those evenly over all rotations. */
enum {
    FIT_TURNS_CUBE = 24,
    FIT_TURNS_FOLD = 6,
    FIT_TURNS_EVEN = 72,
    FIT_SHAPE_TURNS = FIT_TURNS_CUBE + FIT_TURNS_FOLD + FIT_TURNS_EVEN
};

/* *to = the state `from` with its shape turned by turn i about centre[3] (mm, in its frame), which
 * stays in place. axes[9]: the axes of the cube in the frame of the shape, a unit vector in each
 * row. */
void sdm_fit_shape_turned(const fit_state *from, const double centre[3], const double axes[9],
                          size_t i, fit_state *to);

/* Points: list[*n], at most `most`, the best first: poses of the shape, none near another one, that
   some iterations of the pose alone reach from the best of these turns and from half turns about
   the axes of the frame of the shape and about the principal axes of the points. Points show a part
   of the surface, so that a wrong pose may have distorted parameters: params 0 keeps those of the
   state of *p; 1 moves those at an end of their range to its middle; 2 takes those of the start. *n
   = 0 where this changes none. The points have a wide deviation in these states; the likelihood
   with it ranks them. The state of *p stays, its samples are others. SDM_E_NOMEM, SDM_E_CANCELLED.
 */
sdm_status sdm_fit_turned_starts(fit_problem *p, const double centre[3], const double axes[9],
                                 int params, size_t most, fit_start *list, size_t *n,
                                 sdm_error *err);
