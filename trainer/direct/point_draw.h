/* Draws the voxels of a map that a point network is trained on. */
#pragma once

#include "data/dataset.h"

/* Random voxel of the map in `slot`, from counter-based number `index` of STREAM_POINTS. Voxels
   with abs(distance) < train.near_mm are drawn 1 + train.near_weight times as often as the others.
   [any thread] */
size_t trainer_point_draw(const sdm_config *c, const dataset *d, size_t slot, uint64_t index);

/* `voxel`, moved back by one along each axis on which it is the last voxel, so that it has a next
 * neighbour along every axis. All grid sizes must be at least 2. */
size_t trainer_point_with_neighbours(const sdm_grid *g, size_t voxel);
