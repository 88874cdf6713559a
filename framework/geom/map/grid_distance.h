/* Unsigned distances of all voxels of a grid from a surface. */
#pragma once

#include <stdbool.h>

#include "features/nearest.h"
#include "sdm/exact.h"

/* values[nz][ny][nx] = unsigned distance in mm; slot[nz][ny][nx] (may be NULL) = slot of a nearest
   triangle (its position in the order of the tree). With a band (band_mm < INFINITY) distances >=
   band_mm become band_mm and their slots SDM_NONE. g must have passed sdm_grid_check(). Uses
   n_threads, memory_limit, cancelled and user of opts; the bits do not depend on n_threads. Errors:
   SDM_E_NOMEM, SDM_E_CANCELLED; the output is incomplete then. */
sdm_status sdm_grid_distance(const sdm_nearest *surface, const sdm_grid *g,
                             const sdm_exact_opts *opts, double band_mm, float *values,
                             uint32_t *slot, sdm_error *err);

/* The same for the voxels of blocks only, with the narrow band blocks->band_mm: fills
   blocks->values, also of voxels beyond the grid. blocks->grid must have passed sdm_grid_check();
   blocks->tile and blocks->values are set. */
sdm_status sdm_grid_distance_blocks(const sdm_nearest *surface, const sdm_exact_opts *opts,
                                    const sdm_blocks *blocks, sdm_error *err);
