/* Bounding volume hierarchy over the triangles of a mesh: a flat array of boxes, a few triangles a
 * leaf. */
#ifndef SDM_GEOM_BVH_H
#define SDM_GEOM_BVH_H

#include "memory/arena.h"
#include "sdm/mesh.h"

/* Deepest tree that can be built: what a traversal's stack must hold. */
#define SDM_BVH_DEPTH 128

/* count > 0: a leaf of order[first .. first + count). count == 0: children are nodes first and
 * first + 1. */
typedef struct sdm_bvh_node {
    double lo[3], hi[3];
    uint32_t first, count;
} sdm_bvh_node;

/* "Slot": place of a triangle in the tree's order; order[slot] is its index in the mesh. */
typedef struct sdm_bvh {
    sdm_bvh_node *node;
    uint32_t *order;
    size_t n_node, n_tri;
} sdm_bvh;

/* Bytes that a build takes at most: those that stay; to *scratch is added what is taken in passing.
 */
size_t sdm_bvh_bytes(size_t n_tri, size_t *scratch);

/* Splits in the middle of space; the same tree in every call. n_tri > 0. Taken from the low end of
 * the arena. */
sdm_status sdm_bvh_build(const sdm_mesh *m, sdm_arena *arena, sdm_bvh *b, sdm_error *err);
/* The same for a mesh made of pieces of the triangles of the mesh of tree `from`, at less cost:
   piece i is of triangle source[i], which never falls. */
sdm_status sdm_bvh_derive(const sdm_bvh *from, const sdm_mesh *m, const uint32_t *source,
                          sdm_arena *arena, sdm_bvh *b, sdm_error *err);

/* Squared distance from p to a box. */
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

#endif
