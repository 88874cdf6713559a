/* The principal axes of a shape, from the voxels of its map. */
#pragma once

#include "fit/data/map_fields.h"

/* axes[9] = the three principal axes of the shape, a unit vector in its frame in each row: the
 * eigenvectors of the covariance of the voxels of maps->distance inside the shape, about centre[3]
 * (mm). */
void sdm_fit_principal_axes(const fit_maps *maps, const double centre[3], double axes[9]);
