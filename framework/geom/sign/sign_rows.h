/* Finds the signs of a whole grid row by row, in parallel over tiles of rows: from the crossings of
 * the rows with the mesh and, for open meshes, the winding number of the strips that close the
 * boundary (boundary.h). */
#pragma once

#include "row_base.h"
#include "sdm/exact.h"

typedef struct sdm_sign_rows {
    sdm_rows rows;
    const sdm_boundary *boundary; /* NULL: the mesh is closed */
    const sdm_grid *grid;
    int64_t piece; /* open meshes: largest number of voxels of a row in one tile */
} sdm_sign_rows;

/* Are crossings along rows possible and faster than point queries for the signs of a whole grid? */
bool sdm_sign_fits_rows(sdm_sign_method method, const sdm_boundary *b);

/* Finds the crossings of all rows along axis[0] of the grid; axis: a permutation of 0, 1, 2. b:
 * NULL for a closed mesh. *r is zero-initialised. Free with sdm_rows_dispose(&r->rows), also after
 * an error. Uses n_threads and memory_limit of opts. SDM_E_NOMEM. */
sdm_status sdm_sign_rows_build(const sdm_mesh *m, const sdm_boundary *b, const sdm_grid *g,
                               const int axis[3], const sdm_exact_opts *opts, sdm_sign_rows *r,
                               sdm_error *err);

/* Callback for one tile, called in any thread. base[k1 - k0][j1 - j0][i1 - i0]: winding numbers to
 * add to those of the crossings, see sdm_row_base_fill(); NULL for a closed mesh, where tiles
 * contain whole rows. */
typedef void sdm_sign_visit(void *user, const sdm_row_tile *tile, const int32_t *base);

/* Divides n1 x n2 rows into tiles and calls visit() for each, in parallel. Uses n_threads,
 * cancelled and user of opts. SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_sign_tiles(const sdm_sign_rows *r, int64_t n1, int64_t n2,
                          const sdm_exact_opts *opts, sdm_sign_visit *visit, void *user,
                          sdm_error *err);
