/* Which voxels of a map are near the surface. */
#pragma once

#include <math.h>

#include "sdm/grid.h"

/* That distance (mm) in model files that do not state it. */
#define SDM_NEAR_MM_BEFORE 0.4

/* The errors near the surface are those of voxels up to this distance (mm) from it: two voxels by
 * their shortest edge. */
static inline double sdm_grid_near(const sdm_grid *g)
{
    return 2 * fmin(g->spacing[0], fmin(g->spacing[1], g->spacing[2]));
}

/* The second contour of pictures, beside that of the surface: at this distance (mm), five voxels.
 */
static inline float sdm_grid_contour(const sdm_grid *g) { return (float)(2.5 * sdm_grid_near(g)); }
