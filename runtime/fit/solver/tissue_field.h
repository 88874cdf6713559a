/* Tissues lie in places: weights of those outside of the shape that vary smoothly in space. */
#ifndef FIT_PLACES_H
#define FIT_PLACES_H

#include "newton.h"

/* Estimates problem->sites.place anew, from what it is, and problem->sums with it. None where the
   image does not hold two tissues outside, or where they are not wanted. The same bits for any
   number of threads. */
sdm_status sdm_fit_places_update(fit_problem *p, sdm_error *err);

#endif
