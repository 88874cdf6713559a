/* One distance map as the block kernels see it. A block of voxels is cut into up to 8 tiles of 64 voxels, a tile into 8 vectors of 8
   voxels. Positions are relative to the middle of the block (or tile), lengths multiplied by sdm_nearest.scale where in float. */
#ifndef SDM_GEOM_GRID_JOB_H
#define SDM_GEOM_GRID_JOB_H

#include <stdatomic.h>
#include <stdbool.h>

#include "nearest.h"
#include "sdm/grid.h"

/* Eight points. */
typedef struct sdm_points {
    _Alignas(32) float x[3][8];
} sdm_points;

typedef struct sdm_grid_job {
    const sdm_nearest *surface;
    float *values;                    /* [nz][ny][nx] */
    int64_t n[3];                     /* voxels */
    int64_t tile[3];                  /* voxels of a tile along each axis, powers of two with the product 64 */
    int64_t block[3];                 /* voxels of a block: one or two tiles along each axis */
    int64_t n_block[3];               /* blocks */
    double origin[3];                 /* of voxel (0, 0, 0), mm */
    double step[3][3];                /* step[a]: from voxel to voxel along axis a, mm */
    int n_child;                      /* tiles of a block */
    int64_t child_voxel[8][3];        /* first voxel of each tile in its block */
    double child[8][3];               /* middle of each tile relative to the block's, mm */
    _Alignas(64) double voxel[3][64]; /* voxels of a tile relative to its middle, mm */
    sdm_points block_corner, child_middle, tile_corner, voxel_lane;
    float child_shift[8][3], vector_shift[8][3];
    double block_radius; /* mm, half the edges of the block together */
    bool
        small_tiles; /* tiles not larger than the triangles: one feature of a triangle often counts for all of a tile */
    size_t limit;    /* bytes of scratch a thread may take, 0: no limit */
} sdm_grid_job;

/* Linear functions of a triangle as in sdm_lane_triangle, g[3] being the values at the block's middle. */
typedef struct sdm_candidate {
    _Alignas(32) float g[4][8];
} sdm_candidate;

/* What of a triangle is nearest to every voxel of a tile: the face, one edge, one corner; or it is not the same for all. */
enum {
    SDM_KIND_MIXED,
    SDM_KIND_FACE,
    SDM_KIND_EDGE_0,
    SDM_KIND_CORNER_0 = SDM_KIND_EDGE_0 + 3,
    SDM_KINDS = SDM_KIND_CORNER_0 + 3
};

/* Scratch of one thread. */
typedef struct sdm_grid_scratch {
    sdm_candidate *candidate;   /* [cap] */
    float (*corner)[8];         /* [cap] squared distances at the block's corners */
    float (*distance)[8][8];    /* [chunk] squared distances at the voxels of a tile */
    uint32_t *slot;             /* [cap] */
    uint32_t *alive;            /* [cap] */
    uint32_t *list[8];          /* [cap] candidates of each tile */
    uint32_t *kind[SDM_KINDS];  /* [cap] candidates of one tile by what of them can be nearest */
    float (*tile_corner[8])[8]; /* [cap] and their squared distances at its corners */
    size_t cap;
    uint32_t *corner_seen; /* [n_corner] number of the last tile whose list holds the corner */
    uint32_t *edge_seen;   /* [n_edge] */
    uint32_t tile;         /* number of the tile, from 1 */
    uint64_t count[8]; /* work done: nodes, triangles at block corners, at tile corners, at voxels, in double, blocks */
} sdm_grid_scratch;

#define SDM_GRID_CHUNK 128u

/* Makes room for `cap` candidates, content kept. */
sdm_status sdm_grid_scratch_reserve(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err);
void sdm_grid_scratch_dispose(sdm_grid_scratch *s);

/* Unsigned distances of the blocks (0 .. n_block[0], by, bz). The nearest triangles are found in float with a margin for rounding and
   evaluated in double without contraction: instruction sets differ at most in which of several equally near triangles is taken. */
typedef sdm_status sdm_grid_kernel(const sdm_grid_job *job, sdm_grid_scratch *s, int64_t by, int64_t bz,
                                   sdm_error *err);
sdm_grid_kernel sdm_grid_kernel_generic;
#if defined(__x86_64__) && defined(__GNUC__)
sdm_grid_kernel sdm_grid_kernel_avx2;
sdm_grid_kernel sdm_grid_kernel_avx512;
#endif

#endif
