/* Boundary of an open mesh and its part of the generalised winding number (Martens and Bessmeltsev
 * 2025). A strip runs from every boundary edge to infinity along a direction d, so that mesh and
 * strips form a closed surface. A ray in direction -d meets no strip: its signed crossings with the
 * mesh are the winding number of the closed surface. The generalised winding number of the mesh is
 * this number plus the sum of the solid angles of all strips over 4 pi. An edge belongs to the
 * boundary when its triangles do not use it equally often in both directions. */
#pragma once

#include "mesh/topology.h"

/* Node of the tree over the boundary: consecutive edges along the boundary, and the chord from
 * their first to their last vertex. Edges and chord enclose a fan of triangles, so seen from far
 * away their strips have nearly the same solid angle. */
typedef struct sdm_chain {
    double end[2][3]; /* end points of the chord, mm */
    uint32_t vert[2]; /* numbers in the mesh of these end points */
    uint32_t n;       /* number of edges; 1: the chord is the edge itself */
    /* weight of each edge: by how many more triangles use it in one direction than in the other; 0:
     * the edges are not consecutive or differ in weight */
    double weight;
    double length;            /* total length of the edges, mm */
    double fan;               /* area of the fan, mm^2 */
    double centre[3], radius; /* bounding sphere of the edges */
} sdm_chain;

typedef struct sdm_boundary {
    /* [2 n - 1] binary tree in depth-first order: the first child of node i is i + 1, the second i
     * + 2 * (number of edges of the first) */
    sdm_chain *chain;
    size_t n; /* number of boundary edges */
} sdm_boundary;

/* Builds the tree of boundary edges. topo: topology of m. *b is zero-initialised;
 * sdm_boundary_dispose() frees it, also after an error. SDM_E_NOMEM. */
sdm_status sdm_boundary_build(const sdm_mesh *m, const sdm_topology *topo, sdm_boundary *b,
                              sdm_error *err);
void sdm_boundary_dispose(sdm_boundary *b);

/* Direction d of the strips, and the coordinates in which crossings are decided: strips and
 * crossings must agree on which side of an edge a point lies. */
typedef struct sdm_strips {
    const sdm_boundary *boundary;
    /* [n_vert][3] vertices: coordinate 0 increases along -d, coordinates 1 and 2 are transverse */
    const double *across;
    double d[3];       /* unit vector */
    double step[2][3]; /* world vectors of one unit along coordinates 1 and 2, mm */
    int orientation;   /* +1; -1: the three coordinates are left-handed */
} sdm_strips;

/* Winding number of the strips at a point x, with bounds. */
typedef struct sdm_strips_winding {
    double winding; /* solid angle of all strips over 4 pi, signed */
    /* bound on the error of `winding` that the chords cause; excludes rounding errors */
    double error;
    /* bound on abs(gradient of `winding`), times 4 pi, 1/mm */
    double steepness;
    /* lower bound on the distance from x to the boundary, mm; INFINITY without boundary */
    double distance;
} sdm_strips_winding;

/* Winding number of the strips at x. p[2]: coordinates 1 and 2 of x in the system of s->across.
 * tolerance: largest error of the winding number that the replacement of one chain by its chord may
 * cause; 0: no chain is replaced. Errors by whole numbers cannot occur, because the side of x at
 * each strip is exact. [any thread] */
sdm_strips_winding sdm_strips_evaluate(const sdm_strips *s, const double x[3], const double p[2],
                                       double tolerance);

/* Radius (mm) around x within which the winding number of the strips changes by less than `change`
 * (> 0), apart from jumps by whole numbers at a strip. By the law of Biot and Savart the gradient
 * of a solid angle is an integral over the boundary: abs(gradient) <= 1 / (4 pi) * sum over the
 * edges of min(length / r^2, 2 / r) with r the distance from x to the edge. */
double sdm_strips_reach(const sdm_strips_winding *s, double change);
