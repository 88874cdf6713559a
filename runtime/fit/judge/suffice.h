/* Whether the data and the maps suffice for the fit: number and extent of the points, size of the
   voxels of the maps. */
#pragma once

#include "residuals.h"

/* Adds the findings "data" and "size" of a fit to points. */
void sdm_fit_check_points(const fit_problem *p, const fit_residuals *s, sdm_fit_verdict *v);

/* Adds the finding "map voxels", unless the parameters are kept. blur: sd of the point spread, mm;
 * 0: the target is no image. */
void sdm_fit_check_voxels(const fit_problem *p, double blur, sdm_fit_verdict *v);

/* Longest edge (mm) of voxels that show the thickness of the fitted shape. */
double sdm_fit_voxel_for_thickness(const fit_maps *maps);
