/* The features of a surface - faces, edges, corners - each with the region of space from which it can be the nearest.

   For a point p whose nearest point x lies inside a face, p projects into the face; inside an edge, p projects into the edge and lies
   beyond the edge as seen from each of its faces; at a corner, p lies beyond the corner as seen along each of its edges (the regions of
   Mauch 2003). All of these are half spaces, so that whole boxes can be tested at once.

   Triangles are sorted into clusters of eight that lie near each other. Features come in groups of eight, one a lane, every group inside
   one cluster. Float positions are relative to `centre`, lengths multiplied by `scale`. */
#ifndef SDM_GEOM_SURFACE_FEATURES_H
#define SDM_GEOM_SURFACE_FEATURES_H

#include "point_triangle.h"
#include "topology.h"

/* Linear functions of the point p: g[k] . p + offset[k].
   Faces: 0 - 2 the distance outward across each edge, 3 the distance from the plane. A thin face (too narrow for float): 0 - 3 the
   distances outward from a rectangle around it, in its plane. Edges: 0 along it from its middle, 1 and 2 inward across it into two of
   its faces; g[3] is its middle, offset[3] half its length. Lanes without a feature: offset[0] = INFINITY. */
typedef struct sdm_feature_group {
    _Alignas(32) float g[4][3][8];
    float offset[4][8];
} sdm_feature_group;

#define SDM_CORNER_EDGES 6
// where corners are put that are not there: farther than anything the kernels see, and squares are numbers
#define SDM_NOWHERE 1e15f

/* Unit vectors along up to six edges away from each corner (fewer are repeated), and the corners; lanes without one are very far away. */
typedef struct sdm_corner_group {
    _Alignas(32) float along[SDM_CORNER_EDGES][3][8];
    float at[3][8];
} sdm_corner_group;

/* One face or edge: g as above and what its functions are at its anchor. Faces: at_anchor[0 .. 2] of functions 0, 1 and 3 (function 2
   passes through it). Edges: at_anchor[0] is half the length. */
typedef struct sdm_feature_row {
    _Alignas(32) float g[4][3];
    float at_anchor[3], unused;
} sdm_feature_row;

/* A feature in double, mm: its anchor a, a point of it, and a unit vector u: normal of the face (face = -1, else 0), along the edge
   (which ends at a + length u), 0 for a corner. */
typedef struct sdm_feature {
    _Alignas(32) double a[3];
    double u[3], length, face;
} sdm_feature;

/* Node of the tree of clusters: a cluster (n = 1: `first`), or its children are the next node and node `second`. */
typedef struct sdm_cluster_node {
    float lo[3], hi[3];
    uint32_t first, n, second;
} sdm_cluster_node;

#define SDM_CLUSTER_DEPTH 64

/* Numbers of features: face 8 cluster + lane, edge_base + 8 group + lane, corner_base + 8 group + lane. */
typedef struct sdm_features {
    size_t n_cluster, n_node;
    sdm_cluster_node *node;
    uint32_t *slot;                      /* [8 n_cluster] of the frame of a face, SDM_NONE in an empty lane */
    sdm_feature_group *face;             /* [n_cluster] */
    float (*centroid)[3][8];             /* [n_cluster] of the triangles; empty lanes repeat one */
    uint8_t *thin;                       /* [n_cluster] lanes of thin faces */
    uint32_t *edge_first, *corner_first; /* [n_cluster + 1] first group of a cluster */
    sdm_feature_group *edge;
    sdm_corner_group *corner;
    uint32_t edge_base, corner_base, end; /* numbers */
    sdm_feature *exact;                   /* [end] */
    sdm_feature_row *row;                 /* [corner_base] */
    uint32_t (*of_slot)[7];               /* [n_tri] face, edges, corners of a triangle */
    uint32_t *owner;                      /* [end] slot of a triangle that has the feature */
    double centre[3], radius;             /* middle of the surface's box, half its diagonal, mm */
    double scale;                         /* power of two: the longest edge becomes 0.5 .. 1 */
} sdm_features;

/* frames[slot]: of triangle order[slot] of m; topo: of m. *f is zero-initialised; sdm_features_dispose() frees it, also after an
   error. */
sdm_status sdm_features_build(const sdm_mesh *m, const sdm_topology *topo, const sdm_frame *frames,
                              const uint32_t *order, sdm_features *f, sdm_error *err);
void sdm_features_dispose(sdm_features *f);

/* Bytes that a build takes at most: those that stay; to *scratch is added what is taken in passing. */
size_t sdm_features_bytes(size_t n_tri, size_t n_vert, size_t *scratch);

#endif
