/* Which tiles of 8 x 8 x 8 voxels of a grid may hold voxels near a surface. */
#pragma once

#include "features/nearest.h"
#include "sdm/blocks.h"
#include "sdm/exact.h"

/* Sets grid, band_mm and n of *out, and makes its tiles and blocks: a block for each tile that may
   hold a voxel within the band, SDM_TILE_OUTSIDE elsewhere. out->values is not set. g must have
   passed sdm_grid_check(). Uses memory_limit of opts. sdm_blocks_dispose() frees *out, also after
   an error. SDM_E_NOMEM. */
sdm_status sdm_grid_blocks_make(const sdm_nearest *surface, const sdm_grid *g, double band_mm,
                                const sdm_exact_opts *opts, sdm_blocks *out, sdm_error *err);

/* Removes the blocks without a voxel within the band, if their values have one sign: their tiles
   become SDM_TILE_INSIDE or SDM_TILE_OUTSIDE. */
void sdm_grid_blocks_prune(sdm_blocks *b);

/* Bytes allocated by *b. */
size_t sdm_blocks_bytes(const sdm_blocks *b);
