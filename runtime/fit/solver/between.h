/* Maps on a second grid, between the voxels of the first. */
#pragma once

#include "problem.h"

/* The share of a map is sampled at its voxels, so the likelihood changes with the place of the
   grid: where large flat faces of the shape are parallel to the grid, its maxima repeat with every
   voxel, and a fit ends at one of them, far from the best values of parameters that move little
   else. The mean over two grids, the second moved by half a voxel along each axis (a body-centred
   cubic lattice), does not change with their place.

   Adds maps on such a grid, problem->maps.between, where the log-likelihoods of both grids at
   problem->state differ by more than noise. *added: whether it did; the maps are then to be made
   anew by sdm_fit_evaluate(), before which problem->state is no maximum. Does nothing for points,
   for distances in place of shares, and where the second grid is there already. Same bits for any
   number of threads. SDM_E_NOMEM, or an error of the maps. */
sdm_status sdm_fit_between_add(fit_problem *p, bool *added, sdm_error *err);
