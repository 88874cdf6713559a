/* The features of a surface - faces, edges, corners - each with the region of space from which it
   can be the nearest.

   For a point p whose nearest point x lies inside a face, p projects into the face; inside an edge,
   p projects into the edge and lies beyond the edge as seen from each of its faces; at a corner, p
   lies beyond the corner as seen along each of its edges (the regions of Mauch 2003). All of these
   are half spaces, so that whole boxes can be tested at once.

   Up to eight triangles under one node of the tree are a cluster; an edge or corner belongs to the
   first cluster that has it. Float positions of clusters are relative to `centre`, those of
   features to the middle of their cluster's box, lengths multiplied by `scale`. */
#ifndef SDM_GEOM_SURFACE_FEATURES_H
#define SDM_GEOM_SURFACE_FEATURES_H

#include <stdbool.h>

#include "mesh/bvh.h"
#include "mesh/point_triangle.h"
#include "mesh/topology.h"

/* Eight faces or edges or four corners of a cluster, in lanes, by linear functions of the point p:
   g[k] . p + offset[k], and what they are at most in the feature's region. Faces: 0 - 2 the
   distance outward across each edge, 3 the distance from the plane; most 0. A thin face (too narrow
   for float): 0 - 3 the distances outward from a rectangle around it, in its plane. Edges: the size
   of 0, along it from its middle, is at most half its length; 1 and 2 inward across it into two of
   its faces, at most 0, or INFINITY for 1 where there is no face; 3 the distance from the plane of
   the first: 1 and 3 are perpendicular, so that their squares sum up to that of the distance. 1 + 2
   is at most 0, too: that leaves out an edge as seen from where its faces form a valley. Corners: 0
   - 2 the way along edges away from it, at most 0: three edges in its lane, three in the fourth
   lane from there (fewer are repeated); g[3] is the corner itself. Nothing in the lane: offset[0] =
   INFINITY. */
typedef struct sdm_feature_group {
    _Alignas(64) float g[4][3][8]; /* [k][coordinate] */
    float offset[4][8];
    float most[2][8]; /* of functions 0 and 1 */
    float sum[4]
             [8]; /* of the sizes of the coordinates of g[k]; 3 of an edge: of (g[1] + g[2]) / 2 */
} sdm_feature_group;

#define SDM_CORNER_LANES 4

/* A feature in double, mm: its anchor a, a point of it, and a unit vector u: normal of the face
   (face = -1, else 0), along the edge (which ends at a + length u), 0 for a corner. */
typedef struct sdm_feature {
    _Alignas(32) double a[3];
    double u[3], length, face;
} sdm_feature;

#define SDM_CLUSTER 8

/* Node of the tree of triangles. count > 0: a cluster of the faces first .. first + count and of
   some edges and corners; what is below it in the tree is not used. count == 0: its children are
   first and first + 1. */
typedef struct sdm_cluster_node {
    float lo[3], hi[3];
    uint32_t first, count;
    uint32_t edge, edge_end, corner, corner_end;
    uint32_t group; /* of its faces; those of its edges follow, then those of its corners */
    uint32_t thin;  /* bit i: face first + i is thin */
} sdm_cluster_node;

/* Numbers of features: a face has the slot of its triangle, edges begin at edge_base, corners at
 * corner_base. */
typedef struct sdm_features {
    sdm_cluster_node *node; /* [nodes of the tree] */
    float (*centroid)[3];   /* [n_tri] of the triangles */
    bool any_thin;          /* there is a thin face */
    sdm_feature_group *group;
    uint32_t edge_base, corner_base, end;
    sdm_feature *exact;       /* [end] */
    uint32_t (*of_slot)[6];   /* [n_tri] edges and corners of a triangle */
    uint32_t *owner;          /* [end] slot of a triangle that has the feature */
    double centre[3], radius; /* middle of the surface's box, half its diagonal, mm */
    double scale;             /* power of two: the longest edge becomes 0.5 .. 1 */
} sdm_features;

/* Coordinate a of the point that the functions of a cluster are relative to. */
static inline float sdm_cluster_middle(const sdm_cluster_node *c, int a)
{
    return 0.5f * (c->lo[a] + c->hi[a]);
}

/* Fills frames[slot], too: of triangle tree->order[slot] of m; topo: of m. Taken from the low end
   of the arena. */
sdm_status sdm_features_build(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                              sdm_arena *arena, sdm_frame *frames, sdm_features *f, sdm_error *err);

#endif
