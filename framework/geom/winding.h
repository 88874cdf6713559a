/* Generalised winding numbers (Jacobson et al. 2013): for meshes that are not closed. */
#ifndef SDM_GEOM_WINDING_H
#define SDM_GEOM_WINDING_H

#include <stdbool.h>

#include "bvh.h"

/* Sum of the solid angles of a node's triangles seen from far away: a dipole at their middle (Barill et al. 2018). */
typedef struct sdm_dipole {
    double middle[3], moment[3]; /* moment: sum of the area vectors */
    double radius;               /* of a ball around the middle that holds the node */
} sdm_dipole;

typedef struct sdm_winding {
    const sdm_mesh *mesh;
    const sdm_bvh *tree;
    sdm_dipole *dipole; /* [n_node] */
} sdm_winding;

/* Mesh and tree must stay as long as *w. *w is zero-initialised; sdm_winding_dispose() frees it. */
sdm_status sdm_winding_build(const sdm_mesh *m, const sdm_bvh *tree, sdm_winding *w, sdm_error *err);
void sdm_winding_dispose(sdm_winding *w);

/* Winding number of x; exact: every triangle by itself. */
double sdm_winding_number(const sdm_winding *w, const double x[3], bool exact);

/* Is the winding number above 1/2? Decided without the dipoles where they are too coarse for it. */
bool sdm_winding_inside(const sdm_winding *w, const double x[3]);

#endif
