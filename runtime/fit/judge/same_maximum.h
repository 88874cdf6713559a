/* Whether two surfaces belong to the same maximum of the likelihood of an image. */
#pragma once

#include "rival.h"

/* True if the image tells neither surface from the other, nor from the surface half-way between
   them: their log-likelihoods differ by less than SDM_FIT_PREFERRED, and the mean of their shares
   explains the voxels as well, neither much worse nor much better: between two maxima lies a
   valley, and where the image shows both surfaces their mean explains more than each. Poses and
   parameters are not compared, so that symmetries of the shape do not count.

   fit, rival: the standings on the same samples; field[n]: the share of the fit at the samples;
   the one of the rival, with its tissues, is in problem->samples. */
bool sdm_fit_same_maximum(const fit_problem *p, const fit_standing *fit, const double *field,
                          const fit_standing *rival);
