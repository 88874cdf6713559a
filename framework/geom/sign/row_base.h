/* For open meshes: the winding number that the strips of the boundary add to the crossings of grid
 * rows, rounded. A voxel with n signed crossings and the strips' winding number w has the
 * generalised winding number n + w, so it is inside (n + w > 1/2) where n + round(w) >= 1. round(w)
 * is constant in large regions: a bound on the gradient of w (boundary.h) proves this for whole
 * boxes of voxels. */
#pragma once

#include "boundary.h"
#include "rows.h"

/* Part of a grid: voxels i0 .. i1 - 1 of the rows with j0 <= j < j1, k0 <= k < k1. */
typedef struct sdm_row_tile {
    int64_t i0, i1, j0, j1, k0, k1;
} sdm_row_tile;

/* Writes base[k1 - k0][j1 - j0][i1 - i0], the rounded winding number of the strips for the voxels
 * of a tile. rows: crossings of the rows of grid g with the mesh whose boundary is b. [any
 * thread] */
void sdm_row_base_fill(const sdm_boundary *b, const sdm_rows *rows, const sdm_grid *g,
                       const sdm_row_tile *tile, int32_t *base);
