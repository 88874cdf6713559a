/* Coarse maps for the search with a wide point spread, which hides their voxels. */
#pragma once

#include "fit/solver/problem.h"

/* Replaces problem->maps by exact maps with voxels of twice the edge, where the blur of the field
   at problem->state is at least as wide as such a voxel, and *fine by the maps so far. A network,
   and points measured on the surface itself, keep their maps. */
sdm_status sdm_fit_coarse_maps_begin(fit_problem *p, fit_maps *fine, sdm_error *err);

/* Puts *fine back, after sdm_fit_coarse_maps_begin(), and adds the work of the coarse maps to it.
 */
void sdm_fit_coarse_maps_end(fit_problem *p, fit_maps *fine);
