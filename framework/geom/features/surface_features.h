/* The features of a surface: its faces, edges and corners (vertices), each with its region, the set
   of points to which it can be the nearest feature (Mauch 2003).

   If the point of the surface nearest to p lies inside a face, p projects into the face. If it lies
   inside an edge, p projects into the edge and, seen from each of the edge's faces, lies beyond the
   edge. If it is a corner, p lies beyond the corner along each of its edges. So every region is an
   intersection of half spaces, and a whole box of points can be tested at once.

   A cluster is a node of the tree with up to eight triangles below it; an edge or corner belongs to
   the first cluster that contains it. Features of a cluster are stored in groups of eight, one in
   each SIMD lane. Float values are scaled: the boxes of clusters are (x - centre) * scale, the
   functions of features take (x - centre of the cluster's box) * scale. */
#pragma once

#include <stdbool.h>

#include "mesh/bvh.h"
#include "mesh/point_triangle.h"
#include "mesh/topology.h"

/* A group: up to eight features of one kind of a cluster, one in each lane (corners: four, two
   lanes each), given by their region functions f[k](p) = g[k] . p + offset[k]. Gradients have
   length 1, or 0 where a function bounds nothing. p lies in the region of a

   face       if f[0], f[1], f[2] <= 0: distances outward across each edge, in the face's plane.
              f[3] is the distance from this plane.
   thin face  if f[0] ... f[3] <= 0: distances outward from a rectangle around the face, in its
              plane. For faces too narrow for float distances.
   edge       if abs(f[0]) <= most[0]: coordinate along the edge from its midpoint; most[0] is
              half its length;
              and f[1] <= most[1], f[2] <= 0: distances inward across the edge into two of its
              faces; most[1] = 0, or INFINITY for an edge without a face that is wide enough;
              and (f[1] + f[2]) / 2 <= most[1]: implied for points, not for boxes. A concave
              edge has no region, but a box may still pass each half-space test; this mean
              rejects it.
              f[3] is the distance from the plane of the first face. It is perpendicular to
              f[1], so the squared distance from the edge's line is f[1]^2 + f[3]^2.
   corner     if f[0] ... f[5] <= 0: coordinates along six of its edges, away from the corner.
              If it has fewer edges, the first is repeated. The lane of the corner holds f[0] to
              f[2]; rows 0 to 2 of the lane SDM_CORNER_LANES higher hold f[3] to f[5]. g[3] is
              the position of the corner.

   Unused lanes have offset[0] = INFINITY: no point satisfies that. */
typedef struct sdm_feature_group {
    /* gradients, [k][coordinate][lane] */
    _Alignas(64) float g[4][3][8];
    float offset[4][8];
    /* edges: largest values of abs(f[0]) and f[1] in the region; faces and corners: 0 */
    float most[2][8];
    /* abs(gx) + abs(gy) + abs(gz) of each gradient g[k]; in a group of edges, sum[3] is that of
       (g[1] + g[2]) / 2 */
    float sum[4][8];
} sdm_feature_group;

/* Largest number of corners of a group. Corner i uses two of the eight lanes, i and
   i + SDM_CORNER_LANES, for its six region functions. */
#define SDM_CORNER_LANES 4

/* A feature in double, mm, for the exact distance. */
typedef struct sdm_feature {
    /* a point of the feature: corner of the face, start of the edge, the corner itself */
    _Alignas(32) double a[3];
    /* unit vector: normal of the face, direction of the edge; 0 for a corner */
    double u[3];
    /* length of an edge, which ends at a + length * u; 0 for a face or a corner */
    double length;
    /* -1: the feature is a face; 0: an edge or a corner */
    double face;
} sdm_feature;

/* Largest number of faces of a cluster. */
#define SDM_CLUSTER 8

/* Node of the tree of triangles; it has the same index as in sdm_bvh.node. count > 0: the node is a
   cluster, and the nodes below it are not used. count == 0: its children are the nodes first and
   first + 1. */
typedef struct sdm_cluster_node {
    /* bounding box, scaled */
    float lo[3], hi[3];
    /* cluster: its faces are the slots first ... first + count - 1 */
    uint32_t first, count;
    /* numbers of the cluster's edges, edge ... edge_end - 1, and corners, corner ... corner_end -
       1 */
    uint32_t edge, edge_end, corner, corner_end;
    /* index of the cluster's group of faces; its groups of edges follow, then its groups of
       corners */
    uint32_t group;
    /* bit i: face first + i is thin */
    uint32_t thin;
} sdm_cluster_node;

/* All features of a surface. Features are numbered: a face by the slot of its triangle, edges from
   edge_base on, corners from corner_base to end - 1. */
typedef struct sdm_features {
    /* nodes of the tree, [sdm_bvh.n_node] */
    sdm_cluster_node *node;
    /* tree over the clusters for searches from single points; NULL: not made */
    const struct sdm_wide_node *wide;
    /* centroids of the triangles, [n_tri][coordinate], scaled */
    float (*centroid)[3];
    /* at least one face is thin */
    bool any_thin;
    /* groups of all clusters, see sdm_cluster_node.group */
    sdm_feature_group *group;
    uint32_t edge_base, corner_base, end;
    /* 8 * group + lane of each edge and corner, [end - edge_base] */
    uint32_t *place;
    /* the features in double, [end] */
    sdm_feature *exact;
    /* numbers of the edges and corners of each triangle, [n_tri][3 edges, 3 corners] */
    uint32_t (*of_slot)[6];
    /* slot of one triangle to which each feature belongs, [end] */
    uint32_t *owner;
    /* side of the surface on which the region of each feature lies, see feature_side.h, [end];
       NULL: not made, or the surface does not bound a solid */
    const int8_t *side;
    /* centre of the surface's bounding box and half its diagonal, mm */
    double centre[3], radius;
    /* power of two that makes the longest edge 0.5 to 1 long */
    double scale;
} sdm_features;

/* Coordinate a of the centre of a cluster's box: the origin of its features' functions, scaled. */
static inline float sdm_cluster_centre(const sdm_cluster_node *c, int a)
{
    return 0.5f * (c->lo[a] + c->hi[a]);
}
