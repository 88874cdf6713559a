/* Tree over the clusters of a surface with up to eight children per node, for searches from single
   points: the boxes of all children are tested at once. */
#pragma once

#include "features/surface_features.h"

/* Bit of sdm_wide_node.child: the child is a cluster, the other bits are the index of its node in
   sdm_features.node. Without the bit they are an index of a wide node. */
#define SDM_WIDE_CLUSTER 0x80000000u

/* Largest number of entries of a stack for a walk: each of the nodes on a path, at most
   SDM_BVH_DEPTH, leaves up to seven. */
#define SDM_WIDE_STACK (7 * SDM_BVH_DEPTH + 1)

/* Node: bounding boxes of the children, scaled, [axis][child]; those of missing children are empty
   (lo = INFINITY, hi = -INFINITY). */
typedef struct sdm_wide_node {
    _Alignas(32) float lo[3][8], hi[3][8];
    uint32_t child[8];
} sdm_wide_node;

/* *out = new tree over the clusters of *f, to be freed with sdm_free(). Node 0 is the root.
   SDM_E_NOMEM. */
sdm_status sdm_wide_tree_build(const sdm_features *f, sdm_wide_node **out, sdm_error *err);

/* Largest number of nodes of this tree. */
size_t sdm_wide_tree_size(const sdm_features *f);
