/* Which voxels of a map are near the surface. */
#pragma once

#include <math.h>
#include <stdbool.h>

#include "sdm/grid.h"

/* That distance (mm) in model files that do not state it. */
#define SDM_NEAR_MM_BEFORE 0.4

/* The errors near the surface are those of voxels up to this distance (mm) from it: two voxels by
 * their shortest edge. */
static inline double sdm_grid_near(const sdm_grid *g)
{
    return 2 * fmin(g->spacing[0], fmin(g->spacing[1], g->spacing[2]));
}

/* Is a voxel inside by its exact distance, where a map has the value `map`? A voxel centre that
 * lies on the surface up to a thousandth of a voxel (flat faces often lie on planes of voxels) is
 * on either side: it counts as on that of the map. */
static inline bool sdm_inside_beside(float exact, float map, float voxel)
{
    return (fabsf(exact) <= 1e-3f * voxel ? map : exact) < 0;
}

/* The second contour of pictures, beside that of the surface: at this distance (mm), about five
 * voxels, as 1, 2 or 5 times a power of ten. */
static inline float sdm_grid_contour(const sdm_grid *g)
{
    const double mm = 2.5 * sdm_grid_near(g), unit = pow(10, floor(log10(mm))), digit = mm / unit;
    return (float)((digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10) * unit);
}
