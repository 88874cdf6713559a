/* Maps between their voxels by polynomials. Internal to the room `fine`. */
#pragma once

#include "sdm/grid.h"

/* fine[voxels of sdm_fine_grid()] = map[nz][ny][nx] and, halfway between its voxels, the polynomial
   through the six nearest ones (all, on shorter axes), along x, then y, then z. SDM_E_NOMEM. */
sdm_status sdm_fine_halve(const int64_t n[3], const float *map, int n_threads, float *fine,
                          sdm_error *err);
