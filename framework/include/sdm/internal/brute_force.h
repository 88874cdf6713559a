/* Signed distance by brute force: the oracle of the tests and the "naive" method. */
#pragma once

#include "sdm/grid.h"
#include "sdm/mesh.h"

#ifdef __cplusplus
extern "C" {
#endif

/* values[nz][ny][nx] = signed distance, mm, negative inside, in double precision by
 * O(voxels * triangles) operations without a tree, as in the reference implementations (VTK; Wang
 * et al., MIDL 2020): distance to the nearest of all triangles of the mesh as given; inside where
 * the generalised winding number, summed over all triangles, is > 1/2. Parallel over the voxels;
 * n_threads 0: the OpenMP default. */
sdm_status sdm_naive_map(const sdm_mesh *mesh, const sdm_grid *grid, int n_threads, float *values,
                         sdm_error *err);

/* Signed distance, mm, at one point x, computed in the same way. */
double sdm_naive_point(const sdm_mesh *mesh, const double x[3]);

#ifdef __cplusplus
}
#endif
