/* How far the voxels of the maps move the unknowns of a fit to points: near edges of the shape the
 * distance that is interpolated between voxels is wrong, everywhere along the edge alike. */
#pragma once

#include "fit/solver/problem.h"

/* Sets spread[N][N], N = p->information.n_unknowns, to the estimated mean products of the changes
 * of the unknowns by the interpolation of the latest map. influence[N][N]: inverse of the
 * information. The same bits for any number of threads. SDM_E_NOMEM. */
sdm_status sdm_fit_map_bias(const fit_problem *p, const double *influence, double *spread,
                            sdm_error *err);

/* The same for images with exact maps: adds the mean products of the changes of the unknowns by two
   maps with voxels of half the edge, to first order, and what still finer ones would add, as the
   error goes with the edge. The share near a sharp edge or a thin wall depends on the voxels,
   everywhere along the edge alike. At most 16 million voxels; where they are not smaller by a
   factor of 1.3, nothing is added. The same bits for any number of threads. SDM_E_CANCELLED,
   SDM_E_NOMEM, or an error of the shape. */
sdm_status sdm_fit_finer_map_bias(const fit_problem *p, const double *influence, double *spread,
                                  sdm_error *err);
