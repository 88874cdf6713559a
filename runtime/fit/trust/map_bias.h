/* How far the voxels of the maps move the unknowns of a fit to points: near edges of the shape the
 * distance that is interpolated between voxels is wrong, everywhere along the edge alike. */
#pragma once

#include "fit/solver/problem.h"

/* Sets spread[N][N], N = p->information.n_unknowns, to the estimated mean products of the changes
 * of the unknowns by the interpolation of the latest map. influence[N][N]: inverse of the
 * information. The same bits for any number of threads. SDM_E_NOMEM. */
sdm_status sdm_fit_map_bias(const fit_problem *p, const double *influence, double *spread,
                            sdm_error *err);
