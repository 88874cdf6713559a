/* Distances of all voxels of a grid from a surface. */
#ifndef SDM_GEOM_GRID_DISTANCE_H
#define SDM_GEOM_GRID_DISTANCE_H

#include <stdbool.h>

#include "features/nearest.h"
#include "sdm/exact.h"

/* values[nz][ny][nx] = unsigned distance; slot[nz][ny][nx] (may be NULL) = slot of a nearest
   triangle. Distances from band_mm on become band_mm, their slots SDM_NONE; INFINITY: no band. Uses
   n_threads, memory_limit, cancelled and user of opts. The grid is checked. */
sdm_status sdm_grid_distance(const sdm_nearest *surface, const sdm_grid *g,
                             const sdm_exact_opts *opts, double band_mm, float *values,
                             uint32_t *slot, sdm_error *err);

#endif
