/* The nearest point of a surface: tree and frames of the triangles for single points, features for
 * many at once. */
#ifndef SDM_GEOM_NEAREST_H
#define SDM_GEOM_NEAREST_H

#include "mesh/bvh.h"
#include "surface_features.h"

typedef struct sdm_nearest {
    sdm_bvh tree;
    sdm_frame *frames;     /* [slot] */
    sdm_features features; /* for many points at once */
} sdm_nearest;

/* topo: of m, n->tree: its tree. The rest is taken from the low end of the arena. */
sdm_status sdm_nearest_build(const sdm_mesh *m, const sdm_topology *topo, sdm_arena *arena,
                             sdm_nearest *n, sdm_error *err);

/* Squared distance from x to the nearest triangle with a squared distance below `bound`; then
 *slot, q and *feature are set, else `bound` is returned and nothing is written. */
double sdm_nearest_find(const sdm_nearest *n, const double x[3], double bound, uint32_t *slot,
                        double q[3], int *feature);

/* Of the features of triangle *slot the nearest to x: its squared distance, the bits that maps are
 * made of; *slot becomes its owner's. */
double sdm_nearest_feature(const sdm_nearest *n, const double x[3], uint32_t *slot);

#endif
