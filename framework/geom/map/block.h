/* State of the current block, shared by stages 3 to 6. Part of map.inc, which defines the terms. */
#pragma once

#include "features/ambiguity.h"
#include "grid_scratch.h"

/* The current block. Stages 3 to 5 use float positions relative to its centre, scaled. */
typedef struct block {
    const sdm_grid_job *job;
    sdm_grid_scratch *scratch;
    // [tile]: bit v is set where vector v begins inside the grid
    uint8_t vectors_in_grid[8];
    // bit t: tile t meets the region of at least one feature
    unsigned tiles_met;
    // bound on the rounding error of a region function within the block
    float error;
    // [tile][vector]: a feature whose squared distance from the vector's centre is larger is not
    // the nearest feature of any voxel of the vector
    _Alignas(32) float far2[8][8];
    // with a narrow band: a feature whose squared distance from the centre of a tile is larger lies
    // outside the band for every voxel of the tile; INFINITY without a band
    float tile_far2;
    // [SDM_BLOCKS, SDM_TILES, SDM_VECTORS]: half[level] * sdm_block_group.extent bounds the change
    // of a function from the centre of the block, of a tile or of a vector to its corners
    float half[SDM_PART_LEVELS];
} block;

/* Is a block a cube along x, y, z? Then a linear function with gradient g changes from its centre
   to its corners by at most half (|gx| + |gy| + |gz|), which sdm_feature_group.sum holds. */
static inline bool block_is_cube(const sdm_grid_job *job)
{
    const float *half = job->part[SDM_BLOCKS].half;
    return job->aligned && half[0] == half[1] && half[0] == half[2];
}
