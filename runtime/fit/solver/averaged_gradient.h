/* Averaged gradient for fits with exact maps.

   A signed distance has creases: surfaces where the nearest point of the shape jumps. As a
   parameter changes, creases sweep over the samples, and the log-likelihood has a kink each time.
   Its gradient jumps there, and steps along it oscillate. The mean of the derivative over an
   interval is a difference quotient of the log-likelihood, which is continuous (Ermoliev, Norkin
   and Wets 1995). On a map, pose and tissues cause no such kinks: their derivatives are not
   averaged. Distances of points from the surface itself have them in the pose, too. */
#pragma once

#include "problem.h"

/* half_width[n_params], in the units of the parameters: half width of the interval over which the
   derivative by each parameter is averaged. Changing a parameter by its half width moves the part
   of the surface that it moves (sqrt(sum of motion^4 / sum of motion^2)) by 0.03 voxels of the map;
   for points measured on the surface itself, by at most 0.3 standard deviations of their distances.
   The half width is at most 0.05 of the parameter's range. The problem must be evaluated, with
   derivatives. */
void sdm_fit_averaging_widths(const fit_problem *p, double *half_width);

/* Replaces the derivatives by the parameters in problem->information.gradient by their means over
   +-half_width, cut off at the bounds of the parameters; of points measured on the surface itself
   also those by the pose, over the same motion. The problem must be evaluated at its state.
   Computes two maps for each parameter, and leaves problem->maps out of date. */
sdm_status sdm_fit_average_gradient(fit_problem *p, const double *half_width, sdm_error *err);
