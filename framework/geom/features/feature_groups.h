/* Computes the data of all features (frames, groups, exact features) once they are numbered and
   assigned to clusters; see surface_features.h. */
#pragma once

#include "surface_features.h"

/* Largest number of edges that bound the region of a corner; further edges are ignored, which only
   enlarges the region. */
#define SDM_CORNER_EDGES 6u

/* Unit vectors from a corner along the first n of its edges. */
typedef struct sdm_corner_edges {
    float u[SDM_CORNER_EDGES][3];
    uint32_t n;
} sdm_corner_edges;

/* Input, output and scratch arrays of sdm_features_build(). */
typedef struct sdm_feature_builder {
    const sdm_mesh *m;
    const sdm_topology *topo;
    const sdm_bvh *tree;
    /* output: frames of the triangles, [slot] */
    sdm_frame *frames;
    /* output: the features; their numbers and the boxes of the clusters are set before the
       groups */
    sdm_features *f;
    /* feature number of each edge of the topology, [topo->n_edges]; SDM_NONE: not yet numbered */
    uint32_t *edge;
    /* feature number of the corner at each vertex, [n_vert]; SDM_NONE: not yet numbered */
    uint32_t *corner;
    /* for each edge feature the index of its edge in the topology, or topo->n_edges + triangle for
       a triangle with a repeated vertex (a segment), [corner_base - edge_base] */
    uint32_t *edge_source;
    /* vertex of each corner, [end - corner_base] */
    uint32_t *vertex;
    /* scratch: vertices of each edge feature, set by segment_find(), [corner_base - edge_base] */
    uint32_t (*segment)[4];
    /* scratch: whether the direction from an edge into the triangle is unreliable, [n_tri] */
    bool *narrow;
    /* scratch, zeroed: edges of each corner, [end - corner_base] */
    sdm_corner_edges *along;
} sdm_feature_builder;

/* Fills frames, centroids, groups and exact features for all n clusters of a surface. The boxes of
   the clusters and the numbers of features and groups must be set. Both variants give the same
   bits. */
typedef void sdm_feature_groups(const sdm_feature_builder *b, sdm_cluster_node *const *cluster,
                                size_t n);
sdm_feature_groups sdm_feature_groups_generic;
sdm_feature_groups sdm_feature_groups_avx2;
