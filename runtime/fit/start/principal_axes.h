/* The principal axes of a shape, from the voxels of its map. */
#pragma once

#include "fit/data/map_fields.h"

/* axes[9]: rows, unit vectors in the frame of the shape: the principal axes of the places of the
 * voxels of maps->distance that lie inside, about centre[3] (mm). */
void sdm_fit_principal_axes(const fit_maps *maps, const double centre[3], double axes[9]);
