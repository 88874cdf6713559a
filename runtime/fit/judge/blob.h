/* Compares the fitted shape with a blob, the ellipsoid that has its volume, centre of mass and
   second moments. If the blob explains the data as well as the shape, they do not show the shape's
   form. */
#pragma once

#include "rival.h"

/* Adds the finding "blob": the gain of the fit over the blob of the same tissues and point spread.
   None where the shape is nearly a blob itself. factor: as fit_standing. SDM_E_NOMEM. */
sdm_status sdm_fit_check_blob(const fit_problem *p, double factor, sdm_fit_verdict *v,
                              sdm_error *err);
