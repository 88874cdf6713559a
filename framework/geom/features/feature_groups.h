/* The features of clusters: from the triangles, edges and corners that they are numbered by to
 * their data. */
#ifndef SDM_GEOM_FEATURE_GROUPS_H
#define SDM_GEOM_FEATURE_GROUPS_H

#include "surface_features.h"

#define SDM_CORNER_EDGES 6u

/* Unit vectors along the first n edges away from a corner, as they are found. */
typedef struct sdm_corner_edges {
    float u[SDM_CORNER_EDGES][3];
    uint32_t n;
} sdm_corner_edges;

/* The mesh, its tree and what is numbered; the rest is to be filled. */
typedef struct sdm_feature_builder {
    const sdm_mesh *m;
    const sdm_topology *topo;
    const sdm_bvh *tree;
    sdm_frame *frames; /* [slot] */
    sdm_features *f;
    uint32_t *edge;   /* [n_edges] number of an edge of the topology */
    uint32_t *corner; /* [n_vert] number of a corner */
    uint32_t *origin; /* [corner_base - edge_base] edge of the topology; n_edges + triangle for one
                         with a repeated vertex */
    uint32_t *vertex; /* [end - corner_base] vertex of a corner */
    uint32_t (*segment)[4]; /* [corner_base - edge_base] scratch: vertices of an edge and opposite
                               to it */
    bool *narrow; /* [n_tri] scratch: the triangle has no reliable direction into it from an edge */
    sdm_corner_edges *along; /* [end - corner_base] scratch, cleared */
} sdm_feature_builder;

/* Fills frames, groups and exact features of n clusters, those of all of the surface, whose
 * numbers, groups and boxes are known. */
typedef void sdm_feature_groups(const sdm_feature_builder *b, sdm_cluster_node *const *cluster,
                                size_t n);
sdm_feature_groups sdm_feature_groups_generic;
sdm_feature_groups sdm_feature_groups_avx2;

#endif
