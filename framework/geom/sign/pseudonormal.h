/* Angle-weighted pseudo-normals (Baerentzen and Aanaes 2005): they give the sign of the distance to
 * a manifold mesh without self-intersections. */
#pragma once

#include "mesh/topology.h"

typedef struct sdm_pseudonormals {
    double (*vertex)[3]; /* [n_vert] pseudo-normals of the welded vertices */
    double (*edge)[3];   /* [n_edges] pseudo-normals of the edges */
    double (*face)[3];   /* [n_tri] unit normals of the faces; 0 for a triangle without area */
} sdm_pseudonormals;

/* Computes the pseudo-normals: sums the face normals at every vertex (weighted by angle) and at
 * every edge. topo: topology of m. *p is zero-initialised; sdm_pseudonormals_dispose() frees it,
 * also after an error. SDM_E_NOMEM. */
sdm_status sdm_pseudonormals_build(const sdm_mesh *m, const sdm_topology *topo,
                                   sdm_pseudonormals *p, sdm_error *err);
void sdm_pseudonormals_dispose(sdm_pseudonormals *p);

/* The pseudo-normal (not normalised) at a feature of triangle `tri`: SDM_CORNER_0 .. SDM_FACE
 * (point_triangle.h). [any thread] */
const double *sdm_pseudonormal(const sdm_pseudonormals *p, const sdm_topology *topo, uint32_t tri,
                               int feature);
