/* Signs by rows of a grid, tile by tile in all threads: crossings, and on open meshes what the
 * boundary adds. */
#ifndef SDM_GEOM_SIGN_ROWS_H
#define SDM_GEOM_SIGN_ROWS_H

#include "row_base.h"
#include "sdm/exact.h"

typedef struct sdm_sign_rows {
    sdm_rows rows;
    const sdm_boundary *boundary; /* NULL: the mesh is closed */
    const sdm_grid *grid;
    int64_t piece; /* on an open mesh: voxels of a row in a tile at most */
} sdm_sign_rows;

/* Is the sign of a whole grid found by rows? Else by points. */
bool sdm_sign_fits_rows(sdm_sign_method method, const sdm_boundary *b);

/* Rows along axis[0]. Free with sdm_rows_dispose(&r->rows), also after an error. Uses n_threads and
 * memory_limit of opts. */
sdm_status sdm_sign_rows_build(const sdm_mesh *m, const sdm_boundary *b, const sdm_grid *g,
                               const int axis[3], const sdm_exact_opts *opts, sdm_sign_rows *r,
                               sdm_error *err);

/* Called for every tile, in any thread. base[k1 - k0][j1 - j0][i1 - i0]: see sdm_row_base_fill();
   NULL on a closed mesh, whose tiles are of whole rows. */
typedef void sdm_sign_visit(void *user, const sdm_row_tile *tile, const int32_t *base);

/* Cuts n1 x n2 rows into tiles and visits them. Uses n_threads, cancelled and user of opts. */
sdm_status sdm_sign_tiles(const sdm_sign_rows *r, int64_t n1, int64_t n2,
                          const sdm_exact_opts *opts, sdm_sign_visit *visit, void *user,
                          sdm_error *err);

#endif
