/* Regular voxel grid of a map. These conventions hold everywhere: lengths in mm; coordinate system
 * LPS (x to the left, y to posterior, z to superior); indices (i, j, k) run along (x, y, z); x is
 * fastest in memory: values[nz][ny][nx]. */
#ifndef SDM_GRID_H
#define SDM_GRID_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* world = origin + dir * diag(spacing) * (i, j, k). origin is the CENTRE of voxel (0, 0, 0), in mm;
 * spacing is in mm; dir is a row-major orthonormal 3 x 3 matrix (reflections are allowed). */
typedef struct sdm_grid {
    /* number of voxels along x, y, z: what configurations, options of the program, JSON and Python
     * call `size` */
    int64_t n[3];
    double origin[3];
    double spacing[3];
    double dir[9];
} sdm_grid;

/* Returns an axis-aligned grid of n[3] voxels, with the same spacing (mm) along all axes and its
 * centre at `centre` (mm). The arguments are not checked. */
SDM_API sdm_grid sdm_grid_centred(const int64_t n[3], double spacing, const double centre[3]);

/* Checks that 1 <= n[i] <= 2^20, that an array of four doubles per voxel would be addressable,
 * 1e-100 <= spacing[i] <= 1e100 mm, abs(origin[i]) <= 1e100 mm, and that dir is orthonormal to
 * 1e-6. SDM_E_ARG names the first violation. [any thread] */
SDM_API sdm_status sdm_grid_check(const sdm_grid *g, sdm_error *err);

/* Number of voxels. The grid must have passed sdm_grid_check(). [any thread] */
SDM_API size_t sdm_grid_count(const sdm_grid *g);

/* Index of voxel (i, j, k), along x, y, z, in a map: values[sdm_grid_voxel(g, i, j, k)]. The voxel
 * must lie in the grid. [any thread] */
SDM_API size_t sdm_grid_voxel(const sdm_grid *g, int64_t i, int64_t j, int64_t k);

/* World position (mm) of a continuous index, and the inverse. [any thread] */
SDM_API void sdm_grid_world(const sdm_grid *g, const double index[3], double world[3]);
SDM_API void sdm_grid_index(const sdm_grid *g, const double world[3], double index[3]);

#ifdef __cplusplus
}
#endif
#endif
