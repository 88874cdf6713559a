/* Averaged gradient for fits with exact maps.

   A signed distance has creases: surfaces where the nearest point of the shape jumps. As a
   parameter changes, creases sweep over the samples, and the log-likelihood has a kink each time.
   Its gradient jumps there, and steps along it oscillate. The mean of a derivative over an interval
   is a difference quotient, which is continuous (Ermoliev, Norkin and Wets 1995). On a map the
   derivatives of the map by the parameters are averaged, see averaged_maps.h: pose and tissues
   cause no such kinks. Distances of points from the surface itself have them in the pose, too:
   there the derivatives of the log-likelihood are averaged. */
#pragma once

#include "problem.h"

/* From now on derivatives are averaged. Sets problem->half_width, in the units of the parameters:
   half width of the interval over which the derivative by each parameter is averaged. Changing a
   parameter by its half width moves the part of the surface that it moves (sqrt(sum of motion^4 /
   sum of motion^2)) by 0.03 voxels of the map; for points measured on the surface itself, by at
   most 0.3 standard deviations of their distances. The half width is at most 0.05 of the
   parameter's range. The problem must be evaluated, with derivatives; evaluate it again. */
void sdm_fit_averaging_begin(fit_problem *p);

/* From now on derivatives are those at the state; evaluate the problem again. */
void sdm_fit_averaging_end(fit_problem *p);

/* Points measured on the surface itself: replaces the derivatives by the parameters and the pose in
   problem->information.gradient by their means over +-half_width, cut off at the bounds, or over
   the same motion. The problem must be evaluated at its state. Makes two surfaces for each
   parameter, and leaves problem->maps out of date. Does nothing for maps. */
sdm_status sdm_fit_average_gradient(fit_problem *p, sdm_error *err);
