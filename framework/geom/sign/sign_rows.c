/* Parallel loop over tiles of grid rows. */
#include "sign_rows.h"

#include "memory/cancel.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include <stdatomic.h>

#define TILE_ROWS 16 // a tile has up to TILE_ROWS x TILE_ROWS rows
// open meshes: largest number of voxels of a row in one tile; limits `base` to 1 MiB per thread
#define PIECE_MAX 1024
// Meshes with at least this many boundary edges use point queries, which are then faster, because
// every box of voxels would test all edges.
#define LONG_BOUNDARY 4096

bool sdm_sign_fits_rows(sdm_sign_method method, const sdm_boundary *b)
{
    return method == SDM_SIGN_CROSSINGS || (method == SDM_SIGN_WINDING && b->n < LONG_BOUNDARY);
}

/* Bytes of the array `base` of one thread (open meshes only). */
static size_t base_bytes(const sdm_sign_rows *r)
{
    return TILE_ROWS * TILE_ROWS * (size_t)r->piece * sizeof(int32_t);
}

sdm_status sdm_sign_rows_build(const sdm_mesh *m, const sdm_boundary *b, const sdm_grid *g,
                               const int axis[3], const sdm_exact_opts *opts, sdm_sign_rows *r,
                               sdm_error *err)
{
    const int n_threads = sdm_threads(opts->n_threads);
    const size_t limit = opts->memory_limit;
    r->boundary = b;
    r->grid = g;
    r->piece = g->n[axis[0]] < PIECE_MAX ? g->n[axis[0]] : PIECE_MAX;
    const size_t bytes = b ? (size_t)n_threads * base_bytes(r) : 0;
    if (limit && bytes >= limit)
        return sdm_fail(err, SDM_E_NOMEM,
                        "the signs of an open mesh need %zu bytes in %d threads, memory_limit "
                        "leaves %zu; raise it or "
                        "use fewer threads",
                        bytes, n_threads, limit);
    return sdm_rows_build(m, g, axis, n_threads, limit ? limit - bytes : 0, &r->rows, err);
}

sdm_status sdm_sign_tiles(const sdm_sign_rows *r, int64_t n1, int64_t n2,
                          const sdm_exact_opts *opts, sdm_sign_visit *visit, void *user,
                          sdm_error *err)
{
    const int64_t n0 = r->rows.n[0], t1 = (n1 + TILE_ROWS - 1) / TILE_ROWS,
                  t2 = (n2 + TILE_ROWS - 1) / TILE_ROWS;
    const int64_t t0 = r->boundary ? (n0 + r->piece - 1) / r->piece : 1;
    const int n_threads = sdm_threads(opts->n_threads);
    (void)n_threads; // unused without OpenMP
    // one parallel loop over all tiles; the first error stops it
    atomic_int stop = SDM_OK;
    sdm_status status = SDM_OK;
#pragma omp parallel num_threads(n_threads)
    {
        int32_t *base = NULL;
        sdm_error local = {0};
        sdm_status ready = SDM_OK;
        if (r->boundary)
            ready = sdm_alloc_unset((void **)&base, base_bytes(r), 1, "windings of rows", &local);
#pragma omp for schedule(dynamic)
        for (int64_t t = 0; t < t0 * t1 * t2; t++) {
            if (atomic_load(&stop)) continue;
            sdm_status s = ready;
            // the voxels of tile t
            const int64_t i = t % t0 * r->piece, j = t / t0 % t1 * TILE_ROWS,
                          k = t / t0 / t1 * TILE_ROWS;
            const sdm_row_tile tile = {.i0 = i,
                                       .i1 = t0 > 1 && i + r->piece < n0 ? i + r->piece : n0,
                                       .j0 = j,
                                       .j1 = j + TILE_ROWS < n1 ? j + TILE_ROWS : n1,
                                       .k0 = k,
                                       .k1 = k + TILE_ROWS < n2 ? k + TILE_ROWS : n2};
            // winding numbers to add, then the caller's function
            if (!s && base) sdm_row_base_fill(r->boundary, &r->rows, r->grid, &tile, base);
            if (!s) visit(user, &tile, base);
            if (!s && sdm_cancelled(opts))
                s = sdm_fail(&local, SDM_E_CANCELLED, "map stopped on request");
            if (!s || atomic_exchange(&stop, 1)) continue;
            status = sdm_fail(err, s, "%s", local.text);
        }
        sdm_free(base);
    }
    return status;
}
