/* Hash table that finds a vertex by its coordinates, up to a tolerance. */
#pragma once

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

/* Zero-initialise, then set `tolerance`; sdm_vertex_table_dispose() frees. */
typedef struct sdm_vertex_table {
    double tolerance; /* maximum difference along each axis, mm; > 0 */
    uint32_t *entry;  /* [size] vertex + 1; 0: free */
    size_t size, n;   /* size is 0 or a power of two; n entries are used */
} sdm_vertex_table;

/* *v = an added vertex with an index below n_vert that lies within the tolerance of x; n_vert if
 * there is none. The table stores indices only and reads coordinates from vert[n_vert][3]: entries
 * of vertices that were removed since (index >= n_vert) are skipped, and if an index was reused,
 * its new coordinates count. */
void sdm_vertex_table_find(const sdm_vertex_table *t, const double *vert, uint32_t n_vert,
                           const double x[3], uint32_t *v);
/* Adds vertex v, whose coordinates are vert[v]. SDM_E_NOMEM. */
sdm_status sdm_vertex_table_add(sdm_vertex_table *t, const double *vert, uint32_t v,
                                sdm_error *err);
void sdm_vertex_table_dispose(sdm_vertex_table *t);
