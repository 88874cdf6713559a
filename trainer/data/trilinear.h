/* Trilinear interpolation in a map. */
#pragma once

#include "sdm/grid.h"

/* Value of map[nz][ny][nx] at the index coordinates index[3] along x, y and z, each in 0 .. n - 1.
   [any thread] */
double trainer_trilinear(const sdm_grid *g, const float *map, const double index[3]);
