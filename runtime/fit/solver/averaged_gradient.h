/* The end of a fit with exact maps.
   A distance has creases where two places of a surface are equally near. As a parameter changes
   they sweep over the voxels, and the log-likelihood has a kink at each: derivatives jump, and
   steps by them go to and fro. Its difference over a way is continuous all the same, and the
   derivative's mean over that way (Ermoliev, Norkin and Wets 1995). By the pose and the tissues
   there are no kinks. */
#ifndef FIT_CREASES_H
#define FIT_CREASES_H

#include "newton.h"

/* way[n_params]: half of what derivatives are averaged over, from the maps of problem->state: a
   small motion of the surface, which neither noise nor tissues change. */
void sdm_fit_ways(const fit_problem *p, double *way);

/* The derivatives of problem->sums by the parameters replaced by their means over +-way, or as much
 * of it as lies in the bounds. */
sdm_status sdm_fit_average_gradient(fit_problem *p, const double *way, sdm_error *err);

#endif
