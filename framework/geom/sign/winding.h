/* Generalised winding numbers (Jacobson et al. 2013) of points: for meshes that are not closed. */
#ifndef SDM_GEOM_WINDING_H
#define SDM_GEOM_WINDING_H

#include <stdbool.h>

#include "boundary.h"
#include "mesh/bvh.h"

/* The triangles of a node seen from far away (Barill et al. 2018): Taylor expansion of their solid
 * angle about their middle. */
typedef struct sdm_cluster {
    double middle[3]; /* weighted by area */
    double normal[3]; /* sum of the area vectors */
    double second[6]; /* sum of area vector x (place - middle), symmetric part: xx, yy, zz, xy, yz,
                         zx */
    double spread;    /* integral of |place - middle|^2 over the area */
    double area, radius; /* radius: of a ball around the middle that holds the node */
} sdm_cluster;

typedef struct sdm_winding {
    const sdm_mesh *mesh;
    const sdm_bvh *tree;
    sdm_boundary boundary;
    sdm_cluster *cluster; /* [n_node]; NULL where the boundary is short enough to do without */
} sdm_winding;

/* Mesh and tree must stay as long as *w; topo: of the mesh. *w is zero-initialised;
 * sdm_winding_dispose() frees it. */
sdm_status sdm_winding_build(const sdm_mesh *m, const sdm_bvh *tree, const sdm_topology *topo,
                             sdm_winding *w, sdm_error *err);
void sdm_winding_dispose(sdm_winding *w);

/* Winding number of x to rounding: the crossings of one ray and the boundary where that is less
   work than every triangle. [any thread] */
double sdm_winding_number(const sdm_winding *w, const double x[3]);

/* The same by every triangle. [any thread] */
double sdm_winding_sum(const sdm_winding *w, const double x[3]);

/* Is the winding number above 1/2? Clusters decide where the bound on their error allows it. [any
 * thread] */
bool sdm_winding_inside(const sdm_winding *w, const double x[3]);

#endif
