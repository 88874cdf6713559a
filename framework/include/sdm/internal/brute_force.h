/* Distances by brute force: the oracle of the tests and the "naive" method. */
#ifndef SDM_INTERNAL_BRUTE_FORCE_H
#define SDM_INTERNAL_BRUTE_FORCE_H

#include "sdm/grid.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Oracle and "naive" baseline, O(voxels * triangles) in double as VTK's class and the paper do it,
   without any tree: distance to the nearest of all triangles of the mesh as it is, sign by the
   winding number over all triangles > 1/2. Threaded over voxels. */
sdm_status sdm_naive_map(const sdm_mesh *mesh, const sdm_grid *grid, int n_threads, float *values,
                         sdm_error *err);
double sdm_naive_point(const sdm_mesh *mesh, const double x[3]);

#ifdef __cplusplus
}
#endif
#endif
