/* Topology of a mesh: which vertices coincide, and which triangles share which edges. */
#pragma once

#include "memory/arena.h"
#include "sdm/mesh.h"

/* Value of an index that means "none". */
#define SDM_NONE UINT32_MAX

/* An undirected edge between the welded vertices lo < hi. n_up half-edges run from lo to hi, n_down
 * from hi to lo. */
typedef struct sdm_edge {
    uint32_t lo, hi;
    uint32_t n_up, n_down;
    /* its half-edge with the highest index; the others follow through next[], descending */
    uint32_t first;
} sdm_edge;

/* Half-edge h = 3 t + i runs from corner i to corner (i + 1) % 3 of triangle t. A triangle in which
 * a welded vertex occurs twice has no half-edges. */
typedef struct sdm_topology {
    uint32_t *weld;  /* [n_vert] lowest index of a vertex with the same coordinates */
    uint32_t *tri;   /* [n_tri][3] welded vertices */
    uint32_t *edge;  /* [n_tri][3] index in edges[] of each half-edge; SDM_NONE: no half-edge */
    uint32_t *next;  /* [n_tri][3] next half-edge of the same edge; SDM_NONE at the end */
    sdm_edge *edges; /* [n_edges] */
    size_t n_vert, n_tri, n_edges;
} sdm_topology;

/* Fills *t for m, whose indices are in range. Its arrays are taken from the high end of the arena,
 * scratch memory from the low end. SDM_E_MESH: more than UINT32_MAX / 6 - 1 triangles;
 * SDM_E_NOMEM. */
sdm_status sdm_topology_build(const sdm_mesh *m, sdm_arena *arena, sdm_topology *t, sdm_error *err);

/* The triangle on the other side of half-edge h if exactly two triangles share this edge and they
 * have the same orientation, else SDM_NONE. */
uint32_t sdm_topology_neighbour(const sdm_topology *t, uint32_t h);

/* True for a triangle v in which a vertex occurs twice. */
static inline bool sdm_repeats_vertex(const uint32_t v[3])
{
    return v[0] == v[1] || v[1] == v[2] || v[2] == v[0];
}

/* Finds the connected components ("parts"): triangles that share an edge are in the same part.
 * parent[n_tri] becomes a union-find forest with one tree per part; its root is the triangle with
 * the lowest index. */
void sdm_topology_parts(const sdm_topology *t, uint32_t *parent);

/* Root of i in the union-find forest; shortens the path by path halving. */
uint32_t sdm_forest_root(uint32_t *parent, uint32_t i);

/* Joins the trees of i and j; the smaller root becomes the common root. */
void sdm_forest_join(uint32_t *parent, uint32_t i, uint32_t j);
