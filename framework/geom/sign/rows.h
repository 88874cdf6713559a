/* Crossings of grid rows (lines of voxels along one axis) with a mesh. They give the winding
 * numbers of a closed mesh; for an open mesh the strips of boundary.h must be added. */
#pragma once

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/mesh.h"

typedef struct sdm_row_crossing {
    /* index of the last voxel before the crossing, 0 .. n[0] - 1; crossings beyond the end of the
     * row have n[0] - 1 */
    int32_t last;
    int32_t sign; /* +1: the row leaves the solid here, -1: it enters */
} sdm_row_crossing;

/* All crossings of the rows. A row runs along axis[0] of the grid; row j + n[1] * k has index j
 * along axis[1] and k along axis[2]. */
typedef struct sdm_rows {
    /* crossings of row i: list[first[i] .. first[i + 1] - 1], from the end of the row to its
     * start */
    sdm_row_crossing *list;
    uint32_t *first; /* [n_rows + 1] */
    /* [n_vert][3] vertices of the mesh in index coordinates along axis[0], axis[1], axis[2] */
    double *across;
    int axis[3];
    int64_t n[3];
    int orientation; /* +1; -1: axis[0], axis[1], axis[2] are left-handed */
} sdm_rows;

/* Finds all crossings; those before the first voxel are omitted. The result is exact for vertices
 * rounded to index coordinates; a voxel centre on a triangle lies behind the crossing. The grid
 * must have passed sdm_grid_check(). memory_limit: bytes, 0: none. *r is zero-initialised;
 * sdm_rows_dispose() frees it, also after an error. SDM_E_NOMEM. */
sdm_status sdm_rows_build(const sdm_mesh *m, const sdm_grid *g, const int axis[3], int n_threads,
                          size_t memory_limit, sdm_rows *r, sdm_error *err);
void sdm_rows_dispose(sdm_rows *r);

/* A span of a row: voxels begin .. end - 1 between two crossings. */
typedef struct sdm_row_span {
    const sdm_row_crossing *next, *stop;
    int64_t begin, end;
    int32_t winding; /* winding number of these voxels if the mesh is closed */
} sdm_row_span;

/* Iterates over the spans of a row, from its end to its start: for (sdm_row_span u =
 * sdm_row_spans(r, row); sdm_row_span_next(&u);) */
static inline sdm_row_span sdm_row_spans(const sdm_rows *r, size_t row)
{
    return (sdm_row_span){r->list + r->first[row], r->list + r->first[row + 1], r->n[0], r->n[0],
                          0};
}

static inline bool sdm_row_span_next(sdm_row_span *u)
{
    u->end = u->begin;
    for (; u->next < u->stop && u->next->last + 1 == u->end; u->next++) u->winding += u->next->sign;
    u->begin = u->next < u->stop ? u->next->last + 1 : 0;
    return u->end > 0;
}

/* Intersects a span with the voxels i0 .. i1 - 1: *begin .. *end - 1, empty when *begin >= *end. */
static inline void sdm_row_span_clip(const sdm_row_span *u, int64_t i0, int64_t i1, int64_t *begin,
                                     int64_t *end)
{
    *begin = u->begin > i0 ? u->begin : i0;
    *end = u->end < i1 ? u->end : i1;
}

/* Negates values[i], i0 <= i < i1, of the row values[n[0]] where the winding number is >= 1.
 * base[i1 - i0] is added to the winding number of the crossings; NULL: 0, for a closed mesh. [any
 * thread] */
void sdm_rows_apply(const sdm_rows *r, size_t row, int64_t i0, int64_t i1, const int32_t *base,
                    float *values);
