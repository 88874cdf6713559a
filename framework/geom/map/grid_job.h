/* Description of one distance map, read by all threads: the grid, its division into parts (box,
   block, tile, vector: defined in map.inc) and tables of offsets between them.

   Float positions and lengths are scaled: (x - sdm_features.centre) * sdm_features.scale for
   positions, length * sdm_features.scale for lengths. Doubles are in mm. */
#pragma once

#include <stdbool.h>

#include "features/nearest.h"
#include "features/surface_features.h"
#include "sdm/blocks.h"
#include "sdm/grid.h"

/* Eight points, x[coordinate][lane]. */
typedef struct sdm_points {
    _Alignas(32) float x[3][8];
} sdm_points;

/* Levels of division: a box into blocks, a block into tiles, a tile into vectors. */
enum { SDM_BLOCKS, SDM_TILES, SDM_VECTORS, SDM_PART_LEVELS };

/* One level of division: the eight equal parts of a whole (of a box, a block or a tile). */
typedef struct sdm_grid_parts {
    /* centre of each part relative to the centre of the whole, scaled */
    sdm_points centre;
    /* the same in mm, [part][coordinate] */
    double centre_mm[8][3];
    /* first voxel of each part relative to the first voxel of the whole, [part][axis] */
    int64_t first[8][3];
    /* number of voxels of a part along each axis of the grid */
    int64_t size[3];
    /* half the distance between the outermost voxel centres along each axis of the grid, scaled */
    float half[3];
    /* the same as vectors, [axis][coordinate] */
    float half_axis[3][3];
    /* distance from the centre to the corner voxel centres, rounded up, scaled */
    float radius;
} sdm_grid_parts;

typedef struct sdm_grid_job {
    const sdm_nearest *surface;
    const sdm_features *features;
    /* output: distances in mm, [nz][ny][nx]; unused if `blocks` is set */
    float *values;
    /* output instead of values: only the voxels of these blocks are computed; NULL: all voxels */
    const sdm_blocks *blocks;
    /* output: slot of a nearest triangle, [nz][ny][nx]; may be NULL */
    uint32_t *slot;
    /* number of voxels of the grid along each axis */
    int64_t n[3];
    /* number of voxels of a box along each axis */
    int64_t box[3];
    /* number of boxes that cover the grid along each axis */
    int64_t n_box[3];
    /* position of voxel (0, 0, 0), mm */
    double origin[3];
    /* step[a]: vector from one voxel to the next along grid axis a, mm */
    double step[3][3];
    /* whether the grid axes are the coordinate axes x, y, z */
    bool aligned;
    /* narrow band, scaled: larger distances are replaced by the band; INFINITY: no band */
    float band;
    /* the same in mm */
    double band_mm;
    /* the band is so narrow that it culls more than reference points (map.inc) would */
    bool narrow;
    /* division of a box, a block and a tile, [level] */
    sdm_grid_parts part[SDM_PART_LEVELS];
    /* [tile]: centres of its eight vectors relative to the centre of the block, scaled */
    sdm_points vector[8];
    /* [tile][vector]: positions of its eight voxels relative to the centre of the block, scaled */
    sdm_points voxel[8][8];
    /* [vector][lane]: index of the voxel within its tile (0 to 63), x fastest */
    uint8_t voxel_in_tile[8][8];
    /* [coordinate][vector][lane]: positions of the voxels of a tile relative to its first voxel,
       mm */
    _Alignas(64) double voxel_mm[3][8][8];
    /* [vector][lane]: where the value of the voxel is stored relative to that of the first voxel
       of the tile, if all of the tile is */
    int64_t voxel_store[8][8];
    /* whether the values of lanes 2 i and 2 i + 1 are stored side by side */
    bool paired;
    /* positions of the eight voxels of a vector relative to its centre, scaled */
    sdm_points to_voxel;
    /* whether the offsets of vectors in a tile are exactly twice, and those of tiles in a block
       exactly four times, the offsets of voxels in a vector */
    bool self_similar;
    /* lanes_of[mask]: the lanes of the set bits, ascending, then zeros */
    _Alignas(16) uint16_t lanes_of[256][8];
    /* [level]: largest ratio over the grid axes of a part's half extent to that of a block */
    float extent_ratio[SDM_PART_LEVELS];
    /* bound on the rounding error of a linear function with a unit gradient at a part's centre,
       scaled */
    float error;
    /* largest scratch memory of one thread for one block's features, bytes; 0: unlimited */
    size_t limit;
} sdm_grid_job;

/* Scratch memory of one thread (grid_scratch.h). */
typedef struct sdm_grid_scratch sdm_grid_scratch;

/* Computes the unsigned distances for one row of boxes, those with the indices (0 .. n_box[0] - 1,
   by, bz). Writes job->values and job->slot. Threads may work on different rows, each with its own
   scratch. The nearest feature is found in float with a margin for rounding errors; its distance is
   computed in double without fused multiply-add, so every instruction set gives the same bits. */
typedef sdm_status sdm_grid_kernel(const sdm_grid_job *job, sdm_grid_scratch *scratch, int64_t by,
                                   int64_t bz, sdm_error *err);
sdm_grid_kernel sdm_grid_kernel_generic;
#if defined(__x86_64__) && defined(__GNUC__)
sdm_grid_kernel sdm_grid_kernel_avx2;
sdm_grid_kernel sdm_grid_kernel_avx512;
#endif
