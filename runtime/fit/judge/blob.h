/* Compares the fitted shape with a blob, the ellipsoid that has its volume, centre of mass and
   second moments. If the blob explains the image as well as the shape, the image does not show the
   shape's form. */
#pragma once

#include "fit/solver/problem.h"

/* *gain: log-likelihood of the samples with the fitted shape less that with the blob, of the same
   tissues and point spread. *alike: Dice coefficient of the two on the map; near 1 the shape is a
   blob itself, and the gain says nothing. Partial volume only. */
sdm_status sdm_fit_against_blob(const fit_problem *p, double *gain, double *alike, sdm_error *err);
