/* From a map to the values of a level set: closing at the grid's border, padding, checks. Internal
 * to the level set library. */
#ifndef SDM_BAND_H
#define SDM_BAND_H

#include <stdbool.h>

#include "sdm/vdb.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A box of voxels: values[n[2]][n[1]][n[0]] in mm; voxel (0, 0, 0) has index (-pad, -pad, -pad) in
 * the grid of the map. */
typedef struct sdm_band {
    int64_t n[3];
    int32_t pad;
    float *values;
    bool cut; /* the surface left the grid and has been closed at its border */
} sdm_band;

/* Copies values[nz][ny][nx] (checked for NaN and infinities: SDM_E_ARG) without padding. */
sdm_status sdm_band_copy(const sdm_grid *grid, const float *values, sdm_band *out, sdm_error *err);

/* The same for a level set of half width `width` mm on uniform voxels.
   Cut surface: the solid is intersected with the box that the voxels fill (half a voxel beyond the
   outermost centres) as max(d, d_box), which is the exact distance away from the rim of the cut.
   Wherever the band leaves the grid, the box is padded by the band and the distance there is min
   over points b of the box's faces of |p - b| + max(d(b), 0): exact but for the sampling of b.
   SDM_E_ARG: no surface in the grid. SDM_E_QUALITY: neighbours whose values jump across the band,
   so not a distance map. SDM_E_CANCELLED by opts->cancelled, all that is read of opts. */
sdm_status sdm_band_close(const sdm_grid *grid, const float *values, double width,
                          const sdm_vdb_opts *opts, sdm_band *out, sdm_error *err);

void sdm_band_dispose(sdm_band *b);

#ifdef __cplusplus
}
#endif
#endif
