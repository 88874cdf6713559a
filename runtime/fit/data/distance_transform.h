/* Exact Euclidean distance transform of a grid. */
#pragma once

#include "sdm/grid.h"

/* f[nz][ny][nx], 0 or INFINITY at each voxel, becomes the squared distance (mm^2) to the nearest
   voxel that is 0; INFINITY where there is none. n_threads >= 1; the bits of the result do not
   depend on it. */
sdm_status sdm_fit_distance_transform(const sdm_grid *g, int n_threads, float *f, sdm_error *err);
