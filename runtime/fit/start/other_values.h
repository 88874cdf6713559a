/* A second start for a fit that was refused, or that kept a value: the fitted shape with another
   value of one parameter. */
#pragma once

#include "fit/solver/problem.h"

/* Looks for a higher maximum of the posterior density than the one at problem->state, where a fit
   has ended. The fit of a long shape may end with one end of the shape on the data and the other
   one beyond them: no small change of its length then changes the likelihood. So several values of
   every parameter k with of[k] (NULL: of every one) are compared, each in the pose of the
   fit and, unless it is kept, shifted along the axes of the shape; iterations follow from the best
   few.

   *found = true: problem->state is the best of these maxima, and it explains the data better than
   the fit does. false: problem->state is as before. Samples, maps and information are those of the
   search in either case. The parameters must not all be kept. Errors of the maps. */
sdm_status sdm_fit_other_values(fit_problem *p, const bool *of, bool *found, sdm_error *err);
