/* Area of the surface on a map. */
#pragma once

#include "map_fields.h"

/* *area (mm^2) of the surface distance = 0 of the latest map, and its derivatives
   gradient[n_params] by the parameters; the map must have been made with derivatives. The delta
   function of level sets (Peng, Merriman, Osher, Zhao and Kang 1999) is summed over the voxels
   within 1.5 voxels of the surface: walls thinner than 3 voxels count for less. */
void sdm_fit_maps_area(const fit_maps *m, double *area, double *gradient);
