/* A second start for a fit that was refused: the fitted shape with another value of one parameter.
 */
#pragma once

#include "fit/solver/problem.h"

/* Looks for a higher maximum of the posterior density than the one at problem->state, where a fit
   has ended. The fit of a long shape may end with one end of the shape on the data and the other
   one beyond them: no small change of its length then changes the likelihood. So several values of
   every parameter are compared, each in the pose of the fit and shifted along the axes of the
   shape; iterations follow from the best few.

   *found = true: problem->state is the best of these maxima, and it explains the data better than
   the fit does. false: problem->state is as before. Samples, maps and information are those of the
   search in either case. The parameters and the pose must not be kept. Errors of the maps. */
sdm_status sdm_fit_other_values(fit_problem *p, bool *found, sdm_error *err);
