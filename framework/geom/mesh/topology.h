/* Which vertices coincide and which triangles share which edges. */
#ifndef SDM_GEOM_TOPOLOGY_H
#define SDM_GEOM_TOPOLOGY_H

#include "memory/arena.h"
#include "sdm/mesh.h"

#define SDM_NONE UINT32_MAX

/* An undirected edge lo < hi (welded vertices); n_up triangles run along it from lo to hi, n_down
 * the other way. */
typedef struct sdm_edge {
    uint32_t lo, hi;
    uint32_t n_up, n_down;
    uint32_t first; /* half-edge 3 * triangle + corner; the others follow through next[], falling */
} sdm_edge;

/* Half-edge h = 3 t + i runs from corner i to corner (i + 1) % 3 of triangle t. Triangles with a
 * repeated vertex have none. */
typedef struct sdm_topology {
    uint32_t *weld; /* [n_vert] lowest index of a vertex with the same coordinates */
    uint32_t *tri;  /* [n_tri][3] welded vertices */
    uint32_t
        *edge; /* [n_tri][3] edge of a half-edge, SDM_NONE for triangles with a repeated vertex */
    uint32_t *next;  /* [n_tri][3] next half-edge of the same edge, SDM_NONE at the end */
    sdm_edge *edges; /* [n_edges] */
    size_t n_vert, n_tri, n_edges;
} sdm_topology;

/* Bytes that a build takes at most: those that stay; to *scratch is added what is taken in passing.
 */
size_t sdm_topology_bytes(const sdm_mesh *m, size_t *scratch);

/* Indices must be in range. Taken from the high end of the arena. */
sdm_status sdm_topology_build(const sdm_mesh *m, sdm_arena *arena, sdm_topology *t, sdm_error *err);

/* The triangle on the other side of half-edge h where exactly two triangles of one orientation
 * meet, else SDM_NONE. */
uint32_t sdm_topology_neighbour(const sdm_topology *t, uint32_t h);

/* Is the triangle of these corners none? */
static inline bool sdm_repeats_vertex(const uint32_t v[3])
{
    return v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
}

/* parent[n_tri] becomes a union-find forest of the parts that edges connect; their roots are their
 * first triangles. */
void sdm_topology_parts(const sdm_topology *t, uint32_t *parent);

/* Root of i in a union-find forest; halves paths. */
uint32_t sdm_forest_root(uint32_t *parent, uint32_t i);
/* Joins two trees under the smaller root. */
void sdm_forest_join(uint32_t *parent, uint32_t i, uint32_t j);

#endif
