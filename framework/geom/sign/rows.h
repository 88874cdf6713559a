/* The crossings of all rows of a grid (voxels along one axis) with a mesh: winding numbers of a
   closed mesh, and the part of them that jumps of an open one. */
#ifndef SDM_GEOM_ROWS_H
#define SDM_GEOM_ROWS_H

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/mesh.h"

typedef struct sdm_row_crossing {
    int32_t last; /* last voxel of the row before the crossing: 0 .. n[0] - 1, the last voxel also
                     for crossings after it */
    int32_t sign; /* +1: the row leaves the solid there, -1: it enters */
} sdm_row_crossing;

/* A row lies along axis[0] of the grid; row j + n[1] * k is the j-th along axis[1] and the k-th
 * along axis[2]. */
typedef struct sdm_rows {
    sdm_row_crossing *list; /* of each row from its end to its begin */
    uint32_t *first;        /* [n_row + 1] */
    double *across;         /* [n_vert][3] vertices of the mesh in voxels along the three axes */
    int axis[3];
    int64_t n[3];
    int orientation; /* -1: the three axes are left-handed */
} sdm_rows;

/* Decisions are exact for the vertices rounded to coordinates in voxels; crossings before the first
   voxel are left out. A voxel on a triangle lies after the crossing. The grid is checked.
   memory_limit: bytes, 0 for none. *r is zero-initialised; sdm_rows_dispose() frees it, also after
   an error. */
sdm_status sdm_rows_build(const sdm_mesh *m, const sdm_grid *g, const int axis[3], int n_threads,
                          size_t memory_limit, sdm_rows *r, sdm_error *err);
void sdm_rows_dispose(sdm_rows *r);

/* Voxels begin .. end - 1 of a row between crossings. */
typedef struct sdm_run {
    const sdm_row_crossing *next, *stop;
    int64_t begin, end;
    int32_t winding; /* number of a closed mesh there */
} sdm_run;

/* The runs of a row, from its end to its begin: for (sdm_run u = sdm_runs(r, row);
 * sdm_run_next(&u);) */
static inline sdm_run sdm_runs(const sdm_rows *r, size_t row)
{
    return (sdm_run){r->list + r->first[row], r->list + r->first[row + 1], r->n[0], r->n[0], 0};
}

static inline bool sdm_run_next(sdm_run *u)
{
    u->end = u->begin;
    for (; u->next < u->stop && u->next->last + 1 == u->end; u->next++) u->winding += u->next->sign;
    u->begin = u->next < u->stop ? u->next->last + 1 : 0;
    return u->end > 0;
}

/* Cuts a run to voxels i0 .. i1 - 1 in *begin .. *end - 1. */
static inline void sdm_run_cut(const sdm_run *u, int64_t i0, int64_t i1, int64_t *begin,
                               int64_t *end)
{
    *begin = u->begin > i0 ? u->begin : i0;
    *end = u->end < i1 ? u->end : i1;
}

/* Turns the sign of values[n[0]] where the winding number is at least 1, of voxels i0 .. i1 - 1.
   base[i1 - i0] is added to it; NULL: 0, the mesh is closed. [any thread] */
void sdm_rows_apply(const sdm_rows *r, size_t row, int64_t i0, int64_t i1, const int32_t *base,
                    float *values);

#endif
