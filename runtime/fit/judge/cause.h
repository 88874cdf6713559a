/* Why residuals are not noise: the likely causes, the most probable one first, and the place. */
#pragma once

#include "bounds.h"
#include "misfit.h"
#include "suffice.h"

enum { FIT_PLACE_MAX = 190, FIT_CAUSE_MAX = 510 };

/* What the other checks say. */
typedef struct fit_suspects {
    bool refused;  /* the residuals refuse the fit */
    bool far;      /* they exceed the multiple of their limit that refuses labels and points */
    bool no_shape; /* image: the fit has not found any shape */
    const fit_coarseness *coarse;
    const fit_at_bounds *bounds;
} fit_suspects;

/* text[] = the end of a text on residuals inside the shape: where they are largest, if the fit is
 * on the shape of the data, ": ", and their causes. */
void sdm_fit_residuals_explain(const fit_problem *p, const fit_misfit *m, const fit_suspects *other,
                               char text[FIT_CAUSE_MAX]);

/* The same for residuals beside the shape. */
void sdm_fit_beside_explain(const fit_problem *p, const fit_misfit *m, char text[FIT_CAUSE_MAX]);
