/* The regular grid a map lives on. Everywhere: mm, frame LPS, index (i, j, k) <-> (x, y, z), x
 * fastest: values[nz][ny][nx]. */
#ifndef SDM_GRID_H
#define SDM_GRID_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* world = origin + dir * diag(spacing) * (i, j, k): origin is the CENTRE of voxel (0, 0, 0); dir is
   row-major and orthonormal (a reflection is allowed). */
typedef struct sdm_grid {
    int64_t n[3];
    double origin[3];
    double spacing[3];
    double dir[9];
} sdm_grid;

/* Axis-aligned grid of n voxels of one spacing whose middle is `centre`. */
SDM_API sdm_grid sdm_grid_centred(const int64_t n[3], double spacing, const double centre[3]);

/* Sizes 1 .. 2^20 with a product that fits, spacing finite and positive, origin finite, dir
   orthonormal to 1e-6. SDM_E_ARG names the first that is not. */
SDM_API sdm_status sdm_grid_check(const sdm_grid *g, sdm_error *err);

/* Number of voxels; the grid must have passed sdm_grid_check(). */
SDM_API size_t sdm_grid_count(const sdm_grid *g);

/* World position (mm) of a continuous index, and back. */
SDM_API void sdm_grid_world(const sdm_grid *g, const double index[3], double world[3]);
SDM_API void sdm_grid_index(const sdm_grid *g, const double world[3], double index[3]);

#ifdef __cplusplus
}
#endif
#endif
