/* Which sections of a grid show most of a shape. */
#pragma once

#include "sdm/grid.h"
#include "sdm/status.h"

/* Chooses for each axis of the grid the index at[axis] of the section that is drawn.
 *
 * A section shows a voxel if every voxel on the straight line from it along the section's normal
 * to the section is of the same phase: the inside (negative values of map[nz][ny][nx]), or a hole
 * (the others that have the inside on both sides along two or three axes). The sections start in
 * the middle of the box around the inside; without any inside they stay in the middle of the grid.
 * Then a section moves as long as this shows 1/200 more of the voxels inside and in holes: always
 * the section that gains most, to the middle of the places that are nearly as good. Maps with more
 * than 128 voxels along an axis are sampled. SDM_E_NOMEM. [any thread] */
sdm_status sdm_sections_choose(const sdm_grid *grid, const float *map, int64_t at[3],
                               sdm_error *err);
