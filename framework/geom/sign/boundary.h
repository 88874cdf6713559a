/* The boundary of an open mesh and what it adds to signed crossings (Martens and Bessmeltsev 2025):
   close the mesh with strips that run from every boundary edge to infinity along a direction d. A
   ray against d meets no strip, so its signed crossings with the mesh are the winding number of the
   closed surface, and the generalised winding number of the mesh is that plus the strips' share of
   the sphere, a sum over boundary edges. Boundary is every edge whose triangles do not cancel in
   direction. */
#ifndef SDM_GEOM_BOUNDARY_H
#define SDM_GEOM_BOUNDARY_H

#include "mesh/topology.h"

/* Edges that follow each other along the boundary, and the chord from their first to their last
   vertex. Seen from far away both have nearly the same strips: between them lies a fan of
   triangles. */
typedef struct sdm_chain {
    double end[2][3]; /* of the chord, mm */
    uint32_t vert[2]; /* the same as vertices of the mesh */
    uint32_t n;       /* edges; 1: the chord is the edge */
    double weight;    /* triangles that run along it; 0: the edges do not follow each other */
    double length;    /* of the edges, mm */
    double fan;       /* area of the fan, mm^2 */
    double middle[3], radius; /* of a ball that holds the edges */
} sdm_chain;

typedef struct sdm_boundary {
    sdm_chain *chain; /* [2 n - 1] tree of halves: the first child of i is i + 1, the second i + 2 *
                         (edges of the first) */
    size_t n;         /* boundary edges */
} sdm_boundary;

/* topo: of m. *b is zero-initialised; sdm_boundary_dispose() frees it, also after an error. */
sdm_status sdm_boundary_build(const sdm_mesh *m, const sdm_topology *topo, sdm_boundary *b,
                              sdm_error *err);
void sdm_boundary_dispose(sdm_boundary *b);

/* The direction d of the strips and the coordinates in which crossings are decided: both must see
 * the same side of an edge. */
typedef struct sdm_strips {
    const sdm_boundary *boundary;
    const double
        *across;       /* [n_vert][3] vertices; coordinate 0 rises against d, 1 and 2 are across */
    double d[3];       /* unit vector */
    double step[2][3]; /* unit of coordinates 1 and 2, mm */
    int orientation;   /* -1: the three coordinates are left-handed */
} sdm_strips;

/* What is known of the strips' share around a point. */
typedef struct sdm_strips_share {
    double share;     /* what the strips add to the winding number of the point */
    double error;     /* bound on its error, rounding left aside */
    double steepness; /* 4 pi times a bound on its gradient there */
    double distance;  /* at most that to the nearest boundary edge, mm; infinite without one */
} sdm_strips_share;

/* Share of the strips at x; p[2]: x across d in the coordinates of `across`. tolerance: largest
   error of one chain taken as its chord, 0 for none; whole numbers are right always. [any thread]
 */
sdm_strips_share sdm_strips_find(const sdm_strips *s, const double x[3], const double p[2],
                                 double tolerance);

/* How far from the point (mm) the share is sure to change by less than `change` (> 0), jumps by
   whole numbers left aside. The gradient of a solid angle is an integral over the boundary (law of
   Biot and Savart): at most the sum over its edges of min(length / r^2, 2 / r), r the distance,
   over 4 pi. */
double sdm_strips_reach(const sdm_strips_share *s, double change);

#endif
