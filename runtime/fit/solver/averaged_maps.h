/* Maps with averaged derivatives, see averaged_gradient.h. */
#pragma once

#include "problem.h"

/* Computes problem->maps at its state; the derivatives by the parameters are the means over
   +-problem->half_width, cut off at the bounds: differences of two maps for each parameter, over
   the width of the interval. Errors of sdm_fit_maps_make(). */
sdm_status sdm_fit_averaged_maps(fit_problem *p, sdm_error *err);
