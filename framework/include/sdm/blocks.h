/* A narrow-band map in blocks: distances only near the surface, in blocks of 8 x 8 x 8 voxels (the
 * leaves of OpenVDB), and the sign of everything else. Memory grows with the surface, not with the
 * volume. */
#ifndef SDM_BLOCKS_H
#define SDM_BLOCKS_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Voxels of a block along each axis, and in all. */
#define SDM_BLOCK_SIZE 8
#define SDM_BLOCK_VOXELS 512

/* Elements of sdm_blocks.tile for tiles without a block: all of their values are +band_mm (outside)
 * or -band_mm (inside). */
#define SDM_TILE_OUTSIDE UINT32_MAX
#define SDM_TILE_INSIDE (UINT32_MAX - 1)

/* Tile (i, j, k) of a grid holds its voxels 8 i ... 8 i + 7, 8 j ..., 8 k ... */
typedef struct sdm_blocks {
    sdm_grid grid;
    double band_mm; /* half width of the band, mm, of float precision */
    int64_t n[3];   /* number of tiles along each axis; the last ones may reach beyond the grid */
    /* [n[2]][n[1]][n[0]] number of the block of each tile, or SDM_TILE_OUTSIDE, SDM_TILE_INSIDE */
    uint32_t *tile;
    size_t n_block;
    /* [n_block] index of the first voxel of each block; the blocks are in any order */
    int32_t (*first)[3];
    /* [n_block][z][y][x] distances, mm, negative inside; +-band_mm where abs(distance) >= band_mm.
     * Every block has a value within the band, or values of both signs if the band is narrower than
     * a voxel. Beyond the grid: +band_mm */
    float (*values)[SDM_BLOCK_VOXELS];
} sdm_blocks;

/* Frees the arrays and zeroes *b. */
SDM_API void sdm_blocks_dispose(sdm_blocks *b);

#ifdef __cplusplus
}
#endif
#endif
