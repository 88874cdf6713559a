/* Seeds of the distance transform (edt.c): the points where grid lines (lines through voxel centres
 * along x, y or z) cross the surface. */
#pragma once

#include "method.h"

/* Crossings of all grid lines along one axis. With u < w the two other axes, the line at indices
 * (i_u, i_w) has the number i_u + n[u] * i_w. */
typedef struct sdm_seeds {
    /* [n_lines + 1] crossings of line l: at[first[l] .. first[l + 1] - 1] */
    uint32_t *first;
    /* [n] index coordinate of each crossing along the axis (voxel i at coordinate i), unsorted */
    double *at;
    size_t n;
} sdm_seeds;

/* Finds the crossings of the grid lines along `axis` with run->surface. index[n_vert][3]: vertices
 * of the surface in index coordinates (sdm_grid_index). *seeds is zero-initialised;
 * sdm_seeds_dispose() frees it, also after an error. SDM_E_NOMEM. */
sdm_status sdm_seeds_build(sdm_run *run, const double *index, int axis, sdm_seeds *seeds,
                           sdm_error *err);
void sdm_seeds_dispose(sdm_seeds *seeds);

/* Proved upper bound (mm) on the error of map[nz][ny][nx], the unsigned distances of the voxels to
 * the nearest seed of all three axes: 0 <= map - distance to the surface <= *bound. *bound is
 * INFINITY when there is no seed. index[n_vert][3] as above. SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_seeds_bound(const sdm_run *run, const double *index, const sdm_seeds seeds[3],
                           const float *map, double *bound, sdm_error *err);
