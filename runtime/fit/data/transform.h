/* Exact distance transform of a grid. */
#ifndef FIT_TRANSFORM_H
#define FIT_TRANSFORM_H

#include "sdm/grid.h"

/* f[nz][ny][nx] is 0 or INFINITY, and becomes the squared distance, mm^2, of every voxel to the
   nearest that is 0. n_threads: 1 or more; the same bits for every number. */
sdm_status sdm_fit_transform(const sdm_grid *g, int n_threads, float *f, sdm_error *err);

#endif
