/* Nearest point of a surface: a tree of triangles for single points, features for distance maps.
   The slot of a triangle is its position in the order of the tree (sdm_bvh.order). */
#pragma once

#include "mesh/bvh.h"
#include "surface_features.h"

typedef struct sdm_nearest {
    sdm_bvh tree;
    /* frames of the triangles, [slot] */
    sdm_frame *frames;
    /* features for distance maps, and for single distances with the same bits as in maps */
    sdm_features features;
} sdm_nearest;

/* Builds frames and features of mesh m, whose topology is topo and whose tree is n->tree, set by
   the caller. Memory comes from the low end of the arena, which charges the memory limit. */
sdm_status sdm_nearest_build(const sdm_mesh *m, const sdm_topology *topo, sdm_arena *arena,
                             sdm_nearest *n, sdm_error *err);

/* Finds the triangle nearest to x (mm) among those with a squared distance < bound. Returns its
   squared distance and sets its slot, the closest point q and where on the triangle q lies
   (*feature: SDM_CORNER_0 ... SDM_FACE). Without such a triangle returns `bound` and writes
   nothing. */
double sdm_nearest_find(const sdm_nearest *n, const double x[3], double bound, uint32_t *slot,
                        double q[3], int *feature);

/* Squared distance from x to the nearest of the seven features (face, edges, corners) of the
   triangle with slot *slot, with the same bits as in a distance map. Sets *slot to the owner of
   this feature (sdm_features.owner). */
double sdm_nearest_feature(const sdm_nearest *n, const double x[3], uint32_t *slot);

/* Number of the feature nearest to x, and its squared distance *d2: the minimum over all features
   of sdm_feature_distance2(); of several features with the same squared distance, bit for bit, the
   highest number. [any thread] */
uint32_t sdm_nearest_least(const sdm_nearest *n, const double x[3], double *d2);
