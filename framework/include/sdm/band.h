/* Narrow band of a signed distance map: the values near the surface, in blocks of 8 x 8 x 8 voxels,
   and the side of the surface on which every other block lies. The blocks are those of the leaves
   of OpenVDB. */
#ifndef SDM_BAND_H
#define SDM_BAND_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_BAND_EDGE 8
#define SDM_BAND_VOXELS 512 /* voxels of a block */
/* The side of a block without values. */
#define SDM_BAND_OUTSIDE (-1)
#define SDM_BAND_INSIDE (-2)

/* A band of half width `width`. The grid is divided into blocks, from voxel (0, 0, 0) on; blocks[a]
   = (grid.n[a] + 7) / 8 of them along axis a. Every voxel with abs(distance) < width lies in a
   block with values. In such a block every value with abs(value) < width is the distance; other
   values have the sign of the distance and a magnitude of at least width. Values at voxels beyond
   the end of the grid have no meaning; they are finite. Blocks without values lie on one side of
   the surface, at a distance of at least width. */
typedef struct sdm_band {
    sdm_grid grid;
    double width;      /* mm */
    int64_t blocks[3]; /* along x, y, z */
    /* block[blocks[2]][blocks[1]][blocks[0]]: the number of the block in `values`, counted from 0
       in the order of this array, or SDM_BAND_OUTSIDE or SDM_BAND_INSIDE. */
    int32_t *block;
    size_t n;      /* number of blocks with values */
    float *values; /* [n][8][8][8], mm, negative inside, x fastest */
} sdm_band;

/* values[nz][ny][nx] = the map of a band, cut off at the band: -width .. width. [any thread] */
SDM_API void sdm_band_map(const sdm_band *band, float *values);

/* Frees block and values and sets all members to zero. [any thread] */
SDM_API void sdm_band_dispose(sdm_band *band);

#ifdef __cplusplus
}
#endif
#endif
