/* One distance map as the kernels see it. The grid is cut into boxes of 16 x 16 x 16 voxels (for
   equal spacings), a box into 8 blocks, a block into 8 tiles, a tile into 8 vectors of 8 voxels.
   Float positions are relative to sdm_features.centre, from the features of a block on to its
   middle; lengths are multiplied by sdm_features.scale. */
#ifndef SDM_GEOM_GRID_JOB_H
#define SDM_GEOM_GRID_JOB_H

#include <stdbool.h>

#include "features/nearest.h"
#include "features/surface_features.h"
#include "sdm/grid.h"

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
    sdm_points vector[8];   /* middles of the vectors of each tile, relative to that of the block */
    sdm_points voxel[8][8]; /* [tile][vector] of each vector, the same */
    uint8_t voxel_in_tile[8][8]; /* [vector][lane] number of the voxel in its tile, x fastest */
    _Alignas(64) double tile_voxel[3][64]; /* voxels of a tile relative to its first, mm */
    sdm_points to_voxel;                   /* from the middle of a vector */
    bool alike; /* parts of a tile are as those of a vector, but twice as far apart, of a block four
                   times */
    _Alignas(16) uint16_t lanes_of[256][8]; /* the lanes of a mask in order */
    float share[SDM_GRID_STEPS]; /* at most that share of what a function changes within a block it
                                    changes within a part */
    float error;                 /* bound on the error of a linear function at a part's middle */
    size_t limit;                /* bytes of scratch a thread may take, 0: no limit */
} sdm_grid_job;

/* A cluster, the tiles that it concerns, and the way from its middle to the block's. */
typedef struct sdm_cluster_ref {
    uint32_t node, mask;
    float shift[3];
} sdm_cluster_ref;

enum { SDM_FACES, SDM_THIN_FACES, SDM_EDGES, SDM_CORNERS, SDM_FEATURE_KINDS };

#define SDM_FUNCTIONS 6 /* of a corner; others have four */
#define SDM_FLOATS(x) (sizeof(x) / sizeof(float))

/* A group of features some of which meet the block at hand, as from its middle: a feature in each
 * lane. */
typedef struct sdm_met_group {
    _Alignas(64) float at_block[4][8]; /* the functions there */
    float own_sum[4][8];
    const float (*sum)[8]; /* the group's, or the own one */
    const sdm_feature_group *group;
    const sdm_cluster_ref *cluster;
    uint32_t number; /* of the first feature */
} sdm_met_group;

/* A feature as the parts of a block see it. Its functions are linear: from the middle of a part to
   those of the eight parts it has they change by the same in all parts of that size. */
typedef struct sdm_block_feature {
    _Alignas(64) float to_voxels[SDM_FUNCTIONS][8]; /* from the middle of a vector */
    float at_tiles[SDM_FUNCTIONS][8];               /* the functions there */
    float to_vectors[SDM_FUNCTIONS]
                    [8]; /* from the middle of a tile; unused if sdm_grid_job.alike */
    const float *sum;    /* lane of sdm_met_group.sum */
    float most[2];       /* functions 0 and 1 of an edge */
    float from[3];       /* corner: from it to the middle of the block */
    uint32_t number;
} sdm_block_feature;

/* Features of one kind that are held against the parts of a block together: as many as the fastest
 * cache has room for. */
enum { SDM_BATCH = 24 };

/* Features of one kind that wait for that. There is room for eight more: one group. */
typedef struct sdm_pending {
    sdm_met_group met[SDM_BATCH + 1];
    uint16_t feature[SDM_BATCH + 8]; /* place in met[] of its first float, counted in floats. Lists
                                        are written eight at a time */
    size_t groups, n;
} sdm_pending;

/* A feature of a batch and a tile that meets its region. */
typedef struct sdm_tile_pair {
    uint16_t feature; /* place in sdm_batch.feature[], counted in floats */
    uint16_t vector;  /* the tile's first in the block */
} sdm_tile_pair;

typedef struct sdm_batch {
    sdm_block_feature feature[SDM_BATCH];
    _Alignas(64) float at_vectors[SDM_BATCH * 8][8]
                                 [8]; /* [pair][function][vector]: the functions there */
    sdm_tile_pair pair[SDM_BATCH * 8];
    uint16_t tile[SDM_BATCH * 8 + 8]; /* which meet: place of its first float in feature[] + tile */
    uint16_t vector[SDM_BATCH * 64 + 8]; /* which meet: place of its first float in at_vectors[] */
} sdm_batch;

/* A candidate of a vector. */
typedef struct sdm_candidate {
    uint32_t number; /* of the feature */
    uint32_t before; /* place of the vector's candidate before it, SDM_NONE: none */
    uint32_t voxels; /* bits of those that it may be nearest to, by what was known then */
} sdm_candidate;

/* The candidates of the vectors of a block so far, vectors as [8 tile + vector]: squared distances
   of the nearest and the second nearest to its voxels, number of the nearest. */
typedef struct sdm_candidates {
    _Alignas(64) float first[64][8], second[64][8];
    uint32_t number[64][8];
    uint32_t last[64]; /* place of the last one in the list below, SDM_NONE: none */
    uint32_t open[64]; /* bits of voxels that thin faces leave in doubt */
    sdm_candidate *list;
    size_t n, cap;
} sdm_candidates;

/* Clusters that concern a block. */
typedef struct sdm_cluster_list {
    uint32_t *list;
    size_t n;
} sdm_cluster_list;

/* Scratch of one thread. */
typedef struct sdm_grid_scratch {
    /* clusters of the box at hand */
    uint32_t *node;
    uint8_t *node_hit; /* the blocks that it concerns, see list_hits() */
    sdm_cluster_list block[8];
    sdm_cluster_ref *cluster; /* of the block at hand */
    size_t n_cluster, cluster_cap;
    /* features of the block at hand */
    sdm_pending *pending; /* [SDM_FEATURE_KINDS] */
    sdm_batch *batch;
    sdm_candidates *of_vectors;
} sdm_grid_scratch;

/* What has a fixed size; room for `cap` clusters of a box, for `cap` candidates of the vectors of a
 * block. limit: of bytes, 0: none. */
sdm_status sdm_grid_scratch_start(sdm_grid_scratch *s, sdm_error *err);
sdm_status sdm_grid_scratch_box(sdm_grid_scratch *s, size_t cap, sdm_error *err);
sdm_status sdm_grid_scratch_candidates(sdm_grid_scratch *s, size_t cap, size_t limit,
                                       sdm_error *err);
void sdm_grid_scratch_dispose(sdm_grid_scratch *s);

/* Unsigned distances of the boxes (0 .. n_box[0], by, bz). The nearest feature is found in float
   with a margin for rounding and measured in double without contraction: every instruction set
   gives the same bits. */
typedef sdm_status sdm_grid_kernel(const sdm_grid_job *job, sdm_grid_scratch *s, int64_t by,
                                   int64_t bz, sdm_error *err);
sdm_grid_kernel sdm_grid_kernel_generic;
#if defined(__x86_64__) && defined(__GNUC__)
sdm_grid_kernel sdm_grid_kernel_avx2;
sdm_grid_kernel sdm_grid_kernel_avx512;
#endif

#endif
