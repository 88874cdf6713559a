/* A second opinion on a fit to points: the shape on whose surface they lie most evenly. */
#pragma once

#include "fit/solver/problem.h"

/* Moves problem->state from the estimate of a fit to points to the maximum of the likelihood of
   points that are spread evenly over the surface: each one that lies on it has the density
   1 / area. This density draws the ends of a shape that has grown past its data back to them, where
   the distances of the points alone have a local maximum. It is wrong for data that show a part of
   the surface, so the caller continues without it and keeps the better state. point_sd and the
   share of outliers end at their values of the estimate. *moved = false: the state is the same
   within a hundredth of the range of each parameter. The parameters must not be kept. */
sdm_status sdm_fit_even_points(fit_problem *p, bool *moved, sdm_error *err);
