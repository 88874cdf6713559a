/* The nearest point of a surface: tree, frames of the triangles in double, and the same in float for many points at once. */
#ifndef SDM_GEOM_NEAREST_H
#define SDM_GEOM_NEAREST_H

#include "bvh.h"
#include "point_triangle.h"
#include "topology.h"

/* What the lanes kernels need of a triangle, lengths multiplied by sdm_nearest.scale. Functions of the point p that are linear:
   0 t_0, 1 h_0, 2 t_1, 3 h_1, 4 t_2, 5 h_2 (see sdm_frame) and 6 the distance from the plane. g[0..2][i]: gradient of function i,
   g[3][i]: its value at a. g[0..2][7]: the half lengths of the edges. */
typedef struct sdm_lane_triangle {
    float g[4][8];
    double a[3];
    uint32_t
        corner[3]; /* vertices at (0, 0), (2 half[0], 0) and (cx, cy) of the frame, equal coordinates equal numbers */
    uint32_t edge[3]; /* number of each edge; a triangle with a repeated vertex shares none */
    uint32_t padding[4];
} sdm_lane_triangle;

typedef struct sdm_nearest {
    sdm_bvh tree;
    sdm_frame *frames;        /* [slot] */
    sdm_lane_triangle *lanes; /* [slot] */
    double scale;             /* power of two: the longest edge becomes 0.5 .. 1 */
    double longest;           /* longest edge */
    size_t n_corner, n_edge;  /* numbers of corners and edges are below these */
} sdm_nearest;

/* topo: of m. *n is zero-initialised; sdm_nearest_dispose() frees it, also after an error. */
sdm_status sdm_nearest_build(const sdm_mesh *m, const sdm_topology *topo, sdm_nearest *n, sdm_error *err);
void sdm_nearest_dispose(sdm_nearest *n);

/* Squared distance from x to the nearest triangle with a squared distance below `bound`; then *slot, q and *feature are set, else
   `bound` is returned and nothing is written. */
double sdm_nearest_find(const sdm_nearest *n, const double x[3], double bound, uint32_t *slot, double q[3],
                        int *feature);

#endif
