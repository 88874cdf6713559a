/* Turns a map into the values of a narrow-band level set: checks, padding, closing at the border of
   the grid. Internal to the level set library. */
#pragma once

#include <stdbool.h>

#include "sdm/vdb.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Values on a box of voxels: values[n[2]][n[1]][n[0]] in mm. The first voxel of the box has index
   (-pad, -pad, -pad) in the grid of the map. */
typedef struct sdm_band {
    int64_t n[3];
    int32_t pad;
    float *values;
    bool cut;          /* true: the surface left the grid and was closed at its border */
    int64_t estimated; /* voxels of the band beyond the grid whose distance is estimated */
} sdm_band;

/* Copies values[nz][ny][nx] without padding. SDM_E_ARG: a value is NaN or infinite. */
sdm_status sdm_band_copy(const sdm_grid *grid, const float *values, sdm_band *out, sdm_error *err);

/* Computes the values of a level set whose band has the half width `width` mm, on uniform voxels.
   If the surface leaves the grid, the solid is intersected with the box B that the voxels fill
   (half a voxel beyond the outermost centres): max(d, d_B), the exact distance except near the rim
   of the cut. Where the band leaves the grid, the values are padded by the band. If the surface
   stays in the grid and there is opts->map(), the padding is that map; else the distance there is
   estimated: the minimum over points b of the faces of B of |p - b| + max(d(b), 0), exact except
   for the sampling of b (one point a voxel) and of d(b). SDM_E_ARG: no surface in the grid, or a
   value is not finite. SDM_E_QUALITY: neighbouring values jump across the band, so this is not a
   distance map. SDM_E_CANCELLED from opts->cancelled(), and the errors of opts->map(); other
   members of opts are not used. Call sdm_band_dispose() also after an error. */
sdm_status sdm_band_close(const sdm_grid *grid, const float *values, double width,
                          const sdm_vdb_opts *opts, sdm_band *out, sdm_error *err);

void sdm_band_dispose(sdm_band *b);

#ifdef __cplusplus
}
#endif
