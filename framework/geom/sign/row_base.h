/* What the strips that close an open mesh add to the crossings of grid rows, rounded: with n the
   winding number of the closed surface, the generalised winding number n + share is above 1/2 where
   n + round(share) is at least 1. The rounded share is the same over large parts of a grid: a bound
   on the gradient of the share settles whole boxes of voxels (see boundary.h). */
#ifndef SDM_GEOM_ROW_BASE_H
#define SDM_GEOM_ROW_BASE_H

#include "boundary.h"
#include "rows.h"

/* Voxels i0 .. i1 - 1 of the rows j0 .. j1 - 1, k0 .. k1 - 1 of a grid. */
typedef struct sdm_row_tile {
    int64_t i0, i1, j0, j1, k0, k1;
} sdm_row_tile;

/* base[k1 - k0][j1 - j0][i1 - i0] of a tile of the rows; all of it is written. rows: of the mesh
 * with this boundary and of g. */
void sdm_row_base_fill(const sdm_boundary *b, const sdm_rows *rows, const sdm_grid *g,
                       const sdm_row_tile *tile, int32_t *base);

#endif
