/* Whether the data and the maps suffice for the fit: number and extent of the points, size of the
   voxels of the maps. */
#pragma once

#include "residuals.h"

/* Adds the findings "data" and "size" of a fit to points. SDM_E_NOMEM. */
sdm_status sdm_fit_check_points(const fit_problem *p, const fit_residuals *s, sdm_fit_verdict *v,
                                sdm_error *err);

/* What the voxels of the maps do not show. */
typedef struct fit_coarseness {
    /* longest edge (mm) of voxels that show the shape, or the voxels of labels; INFINITY: these do
     */
    double edge;
    /* what they show then, "the thickness of the shape" */
    const char *detail;
} fit_coarseness;

/* Judges the maps by the fitted shape and by labels. */
fit_coarseness sdm_fit_coarseness(const fit_problem *p);

/* Adds the finding "map voxels", unless the parameters are kept. blur: sd of the point spread, mm;
 * 0: the target is no image. */
void sdm_fit_check_voxels(const fit_problem *p, fit_coarseness coarse, double blur,
                          sdm_fit_verdict *v);

/* Adds the finding "data" if nothing failed before, and the data determine none of the parameters.
 */
void sdm_fit_check_determined(const fit_problem *p, const sdm_fit_result *r, sdm_fit_verdict *v);
