/* Integer winding numbers of closed meshes by signed crossings of axis-parallel rays. */
#ifndef SDM_GEOM_CROSSINGS_H
#define SDM_GEOM_CROSSINGS_H

#include "bvh.h"
#include "sdm/grid.h"

/* Sum over the triangles that the ray from p along `axis` (0..2) in `direction` (+1 or -1) leaves through (+1) or enters through (-1):
   the winding number of p. The ray is moved by an infinitely small amount, so it never meets an edge or a corner. The triangles
   skip[n_skip] are left out. */
int sdm_ray_winding(const sdm_mesh *m, const sdm_bvh *tree, const double p[3], int axis, int direction,
                    const uint32_t *skip, size_t n_skip);

/* The crossings of all rows (fixed j, k) of a grid with a closed mesh. */
typedef struct sdm_row_crossing {
    int32_t last; /* last voxel of the row before the crossing: 0 .. nx - 1 */
    int32_t sign; /* +1: the row leaves the solid there */
} sdm_row_crossing;

typedef struct sdm_rows {
    sdm_row_crossing *list;
    uint32_t *first; /* [ny * nz + 1] */
} sdm_rows;

/* *r is zero-initialised; sdm_rows_dispose() frees it, also after an error. The grid is checked. */
sdm_status sdm_rows_build(const sdm_mesh *m, const sdm_grid *g, sdm_rows *r, sdm_error *err);
void sdm_rows_dispose(sdm_rows *r);

/* Turns the sign of values[nx] where the winding number is at least 1. change[nx] is zero before and after. */
void sdm_rows_apply(const sdm_rows *r, size_t row, int64_t nx, int32_t *change, float *values);

#endif
