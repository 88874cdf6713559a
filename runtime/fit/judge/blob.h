/* The rival of a shape: a blob, the ellipsoid of the same volume and moments in the same place. A
   shape that explains the image no better than a blob is not seen in it. */
#pragma once

#include "fit/solver/problem.h"

/* *gain: log-likelihood of the samples with the fitted shape less that with the blob, of the same
   tissues and point spread. *alike: Dice coefficient of the two on the map; near 1 the shape is a
   blob itself, and the gain says nothing. Partial volume only. */
sdm_status sdm_fit_against_blob(const fit_problem *p, double *gain, double *alike, sdm_error *err);
