/* Which voxels of a map a point network is trained on. */
#ifndef SDM_POINT_DRAW_H
#define SDM_POINT_DRAW_H

#include "data/dataset.h"

/* Voxel of random number `index` (stream STREAM_POINTS) from the map in `slot`: all alike, but
   those near the surface (train.near_mm) 1 + train.near_weight times as often. [any thread] */
size_t point_draw(const sdm_config *c, const dataset *d, size_t slot, uint64_t index);

/* The voxel, or the nearest one that has a neighbour behind it along every axis; every size of the
 * grid is at least 2. */
size_t point_with_neighbours(const sdm_grid *g, size_t voxel);

#endif
