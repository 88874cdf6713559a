/* Generalised winding numbers of points (Jacobson et al. 2013), for meshes that are not closed. */
#pragma once

#include <stdbool.h>

#include "boundary.h"
#include "mesh/bvh.h"

/* Far-field approximation of the triangles of a tree node (Barill et al. 2018): Taylor expansion of
 * the triangles' solid angle around their centroid. */
typedef struct sdm_far_field {
    double centroid[3]; /* centroid of the area, mm */
    double normal[3];   /* sum of the area vectors, mm^2 */
    /* symmetric part of the sum of (area vector) (position - centroid)^T, mm^3: xx, yy, zz, xy, yz,
     * zx */
    double second[6];
    double spread; /* integral of abs(position - centroid)^2 over the area, mm^4 */
    /* area, mm^2, and radius (mm) of a bounding sphere around `centroid` */
    double area, radius;
} sdm_far_field;

typedef struct sdm_winding {
    const sdm_mesh *mesh;
    const sdm_bvh *tree;
    sdm_boundary boundary;
    /* [n_node] far fields of the nodes of the tree; NULL: not needed, because the boundary is
     * short */
    sdm_far_field *far_field;
} sdm_winding;

/* Prepares the winding numbers of mesh m. Mesh and tree must stay valid as long as *w. topo:
 * topology of the mesh, used by this call only. *w is zero-initialised; sdm_winding_dispose() frees
 * it, also after an error. SDM_E_NOMEM. */
sdm_status sdm_winding_build(const sdm_mesh *m, const sdm_bvh *tree, const sdm_topology *topo,
                             sdm_winding *w, sdm_error *err);
void sdm_winding_dispose(sdm_winding *w);

/* Winding number at x up to rounding: the crossings of one ray plus the solid angles of the strips
 * that extend the boundary edges along the ray (boundary.h), or the sum over all triangles where
 * that is faster. [any thread] */
double sdm_winding_number(const sdm_winding *w, const double x[3]);

/* Winding number at x as the sum of the solid angles of all triangles. [any thread] */
double sdm_winding_sum(const sdm_winding *w, const double x[3]);

/* Is the winding number at x above 1/2? Uses the far-field approximation if its error bound leaves
 * no doubt, otherwise sdm_winding_number(). [any thread] */
bool sdm_winding_inside(const sdm_winding *w, const double x[3]);
