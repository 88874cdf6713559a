/* Vertices found again by where they are, to a tolerance. */
#ifndef SDM_GEOM_VERTEX_TABLE_H
#define SDM_GEOM_VERTEX_TABLE_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

/* Zero-initialise, set the tolerance; sdm_vertex_table_dispose(). */
typedef struct sdm_vertex_table {
    double tolerance; /* along each axis; > 0 */
    uint32_t *place;  /* [size] vertex + 1; 0: free */
    size_t size, n;
} sdm_vertex_table;

/* *v = a vertex below n_vert that was added and lies within the tolerance of x; n_vert without one.
   vert[n_vert][3] may have changed since vertices were added, from n_vert on also which ones they
   are. */
void sdm_vertex_table_find(const sdm_vertex_table *t, const double *vert, uint32_t n_vert,
                           const double x[3], uint32_t *v);
/* Adds vertex v. */
sdm_status sdm_vertex_table_add(sdm_vertex_table *t, const double *vert, uint32_t v,
                                sdm_error *err);
void sdm_vertex_table_dispose(sdm_vertex_table *t);

#endif
