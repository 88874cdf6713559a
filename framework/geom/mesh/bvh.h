/* Bounding volume hierarchy over the triangles of a mesh: a flat array of nodes with axis-aligned
 * boxes; at most four triangles per leaf. */
#pragma once

#include "memory/arena.h"
#include "sdm/mesh.h"

/* Bound on the depth of a tree, and so on the length of a traversal stack. */
#define SDM_BVH_DEPTH 128

/* count > 0: a leaf with the triangles order[first .. first + count). count == 0: an inner node
 * with children node[first] and node[first + 1]. lo, hi: bounding box, mm. node[0] is the root. */
typedef struct sdm_bvh_node {
    double lo[3], hi[3];
    uint32_t first, count;
} sdm_bvh_node;

/* A "slot" is the position of a triangle in the order of the tree's leaves; order[slot] is its
 * index in the mesh. */
typedef struct sdm_bvh {
    sdm_bvh_node *node; /* [n_node] */
    uint32_t *order;    /* [n_tri] */
    size_t n_node, n_tri;
} sdm_bvh;

/* Builds *b over m, which has at least one triangle. Deterministic. Its arrays are taken from the
 * low end of the arena, scratch memory from the high end. SDM_E_NOMEM. */
sdm_status sdm_bvh_build(const sdm_mesh *m, sdm_arena *arena, sdm_bvh *b, sdm_error *err);

/* Builds *b like sdm_bvh_build(), but faster, for a mesh m that was cut from a mesh with the tree
 * `from`: triangle i of m is a part of triangle source[i] of the other mesh; source[] is sorted in
 * ascending order. */
sdm_status sdm_bvh_derive(const sdm_bvh *from, const sdm_mesh *m, const uint32_t *source,
                          sdm_arena *arena, sdm_bvh *b, sdm_error *err);

/* Squared distance, mm^2, from p to the box of node n; 0 inside. */
static inline double sdm_bvh_box_distance2(const sdm_bvh_node *n, const double p[3])
{
    double sum = 0;
    for (int i = 0; i < 3; i++) {
        const double below = n->lo[i] - p[i], above = p[i] - n->hi[i];
        const double d = below > above ? below : above;
        if (d > 0) sum += d * d;
    }
    return sum;
}
