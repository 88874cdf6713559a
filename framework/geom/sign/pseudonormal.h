/* Angle-weighted pseudo-normals (Baerentzen and Aanaes 2005): the sign of the distance to a
 * manifold mesh without overlap. */
#ifndef SDM_GEOM_PSEUDONORMAL_H
#define SDM_GEOM_PSEUDONORMAL_H

#include "mesh/topology.h"

typedef struct sdm_pseudonormals {
    double (*vertex)[3]; /* [n_vert], welded vertices */
    double (*edge)[3];   /* [n_edges] */
    double (*face)[3];   /* [n_tri] */
} sdm_pseudonormals;

/* *p is zero-initialised; sdm_pseudonormals_dispose() frees it. */
sdm_status sdm_pseudonormals_build(const sdm_mesh *m, const sdm_topology *topo,
                                   sdm_pseudonormals *p, sdm_error *err);
void sdm_pseudonormals_dispose(sdm_pseudonormals *p);

/* The normal at a feature (point_triangle.h) of a triangle. */
const double *sdm_pseudonormal(const sdm_pseudonormals *p, const sdm_topology *topo, uint32_t tri,
                               int feature);

#endif
