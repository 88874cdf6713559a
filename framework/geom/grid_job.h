/* One distance map as the kernels see it. The grid is cut into boxes of 16 x 16 x 16 voxels (for equal spacings), a box into 8 blocks,
   a block into 8 tiles, a tile into 8 vectors of 8 voxels. Float positions are relative to sdm_features.centre, from the features of a
   block on to its middle; lengths are multiplied by sdm_features.scale. */
#ifndef SDM_GEOM_GRID_JOB_H
#define SDM_GEOM_GRID_JOB_H

#include <stdbool.h>

#include "nearest.h"
#include "sdm/grid.h"
#include "surface_features.h"

/* Eight points. */
typedef struct sdm_points {
    _Alignas(32) float x[3][8];
} sdm_points;

enum { SDM_TO_BLOCKS, SDM_TO_TILES, SDM_TO_VECTORS, SDM_GRID_STEPS };

/* The eight parts of a box, a block or a tile. */
typedef struct sdm_grid_parts {
    sdm_points middle;      /* of each, relative to that of the whole */
    double middle_mm[8][3]; /* the same in mm */
    int64_t first[8][3];    /* first voxel of each in the whole */
    int64_t size[3];        /* voxels of a part */
    float half[3];          /* half extents of its voxel centres along the axes of the grid */
    float axis[3][3];       /* the same as vectors: [axis][coordinate] */
    float radius;           /* half its diagonal */
} sdm_grid_parts;

typedef struct sdm_grid_job {
    const sdm_nearest *surface;
    const sdm_features *features;
    float *values;     /* [nz][ny][nx] */
    uint32_t *slot;    /* [nz][ny][nx] slot of a nearest triangle, or NULL */
    int64_t n[3];      /* voxels */
    int64_t box[3];    /* voxels of a box */
    int64_t n_box[3];  /* boxes */
    double origin[3];  /* of voxel (0, 0, 0), mm */
    double step[3][3]; /* step[a]: from voxel to voxel along axis a, mm */
    bool aligned;      /* the axes of the grid are x, y, z */
    float band;        /* distances beyond it become it; INFINITY: none */
    double band_mm;
    sdm_grid_parts part[SDM_GRID_STEPS];
    sdm_points vector[8];                  /* middles of the vectors of each tile, relative to that of the block */
    sdm_points voxel[8][8];                /* [tile][vector] of each vector, the same */
    uint8_t voxel_in_tile[8][8];           /* [vector][lane] number of the voxel in its tile, x fastest */
    _Alignas(64) double tile_voxel[3][64]; /* voxels of a tile relative to its first, mm */
    uint8_t lanes_of[256][8];              /* the lanes of a mask in order */
    float error;                           /* bound on the error of a linear function at a part's middle */
    size_t limit;                          /* bytes of scratch a thread may take, 0: no limit */
} sdm_grid_job;

/* A cluster, the tiles that it concerns, and the way from its middle to the block's. */
typedef struct sdm_cluster_ref {
    uint32_t node, mask;
    float shift[3];
} sdm_cluster_ref;

enum { SDM_FACES, SDM_THIN_FACES, SDM_EDGES, SDM_CORNERS, SDM_FEATURE_KINDS };

enum { SDM_CLUSTERS }; /* the one kind of what a block has */

/* What concerns a part, kind after kind: nodes of clusters, or places in sdm_grid_scratch.row. Kinds begin at multiples of eight. */
typedef struct sdm_candidates {
    uint32_t *list;
    size_t begin[SDM_FEATURE_KINDS], end[SDM_FEATURE_KINDS];
} sdm_candidates;

/* Scratch of one thread. hit: the parts that a thing concerns, see list_hits(). */
typedef struct sdm_grid_scratch {
    /* clusters of the box at hand */
    uint32_t *node;
    uint8_t *node_hit;
    sdm_candidates block[8];
    sdm_cluster_ref *cluster; /* of the block at hand */
    size_t n_cluster, cluster_cap;
    /* features of the block at hand */
    uint32_t *number, *from; /* from: place of the feature's cluster in cluster[] */
    size_t block_cap;
    sdm_feature_row *row; /* relative to its middle; of a corner g[.][3] is the corner */
    uint8_t *row_hit;
    sdm_candidates tile[8];
    size_t row_cap;
    /* features of the tile at hand, as in its list */
    uint8_t *hit;
    sdm_candidates vector[8];
    float (*value)[8]; /* squared distances of the candidates of a vector, as in its list */
    size_t tile_cap;
} sdm_grid_scratch;

/* Room for `cap` clusters of a box, features of the clusters of a block, of a block, of a tile. limit: of bytes, 0: none. */
sdm_status sdm_grid_scratch_box(sdm_grid_scratch *s, size_t cap, sdm_error *err);
sdm_status sdm_grid_scratch_block(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err);
sdm_status sdm_grid_scratch_rows(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err);
sdm_status sdm_grid_scratch_tile(sdm_grid_scratch *s, size_t cap, size_t limit, sdm_error *err);
void sdm_grid_scratch_dispose(sdm_grid_scratch *s);

/* Unsigned distances of the boxes (0 .. n_box[0], by, bz). The nearest feature is found in float with a margin for rounding and
   measured in double without contraction: every instruction set gives the same bits. */
typedef sdm_status sdm_grid_kernel(const sdm_grid_job *job, sdm_grid_scratch *s, int64_t by, int64_t bz,
                                   sdm_error *err);
sdm_grid_kernel sdm_grid_kernel_generic;
#if defined(__x86_64__) && defined(__GNUC__)
sdm_grid_kernel sdm_grid_kernel_avx2;
sdm_grid_kernel sdm_grid_kernel_avx512;
#endif

#endif
