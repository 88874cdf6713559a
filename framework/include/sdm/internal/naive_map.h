/* Signed distances by brute force: an oracle for tests and the method "naive". */
#ifndef SDM_INTERNAL_NAIVE_MAP_H
#define SDM_INTERNAL_NAIVE_MAP_H

#include "sdm/grid.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes values[nz][ny][nx], the signed distances (mm) of all voxels, in double and without a tree:
 * O(voxels * triangles). The distance is to the nearest of all triangles of the mesh as it is; it
 * is negative where the winding number, a sum over all triangles, exceeds 1/2. Parallel over
 * voxels. SDM_E_ARG, SDM_E_MESH, SDM_E_NOMEM. */
sdm_status sdm_naive_map(const sdm_mesh *mesh, const sdm_grid *grid, int n_threads, float *values,
                         sdm_error *err);

/* The same for one point x (mm), for a mesh that has passed sdm_mesh_audit(); NaN if x is not
 * finite. [any thread] */
double sdm_naive_point(const sdm_mesh *mesh, const double x[3]);

#ifdef __cplusplus
}
#endif
#endif
