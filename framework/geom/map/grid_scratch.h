/* Scratch memory of one thread of the distance map: clusters of the current box and block, queues
   of features, and candidates of each vector. Terms are defined in map.inc. */
#pragma once

#include "grid_job.h"

/* Kinds of features. Thin faces are too narrow for float distances, see sdm_feature_group. */
enum { SDM_FACES, SDM_THIN_FACES, SDM_EDGES, SDM_CORNERS, SDM_FEATURE_KINDS };

/* Largest number of region functions of a feature: corners have six, all other kinds four. */
#define SDM_FUNCTIONS 6

/* A cluster that passed the test against the current block. */
typedef struct sdm_cluster_ref {
    uint32_t node;
    /* bit t: the cluster may hold the nearest feature of a point of tile t */
    uint32_t tiles;
    /* vector from the centre of the cluster to the centre of the block, scaled */
    float shift[3];
} sdm_cluster_ref;

/* A group of features listed for the current block, because the region of at least one of them
   meets the block, and its region functions (the functions that bound the regions) at the block. */
typedef struct sdm_block_group {
    /* region functions at the centre of the block, [row][lane] */
    _Alignas(64) float at_block[4][8];
    /* storage for `extent` if sdm_feature_group.sum does not apply, see group_extent() */
    float own_extent[4][8];
    /* the largest change of each function from the centre of the block to its corners is
       extent[row][lane] * block.half[SDM_BLOCKS]; points to group->sum or own_extent */
    const float (*extent)[8];
    const sdm_feature_group *group;
    const sdm_cluster_ref *cluster;
    /* number of the feature in lane 0 */
    uint32_t number;
} sdm_block_group;

/* One feature of a batch, prepared for the parts of the current block. Its region functions are
   linear: their steps from the centre of a whole to the centres of its eight parts are the same for
   all wholes of a level. */
typedef struct sdm_block_feature {
    /* steps of the functions from the centre of a vector to its voxels, [function][voxel] */
    _Alignas(64) float to_voxels[SDM_FUNCTIONS][8];
    /* values of the functions at the centres of the tiles, [function][tile] */
    float at_tiles[SDM_FUNCTIONS][8];
    /* steps of the functions from the centre of a tile to the centres of its vectors,
       [function][vector]; unused if sdm_grid_job.self_similar */
    float to_vectors[SDM_FUNCTIONS][8];
    /* sdm_block_group.extent of the feature's group, and the feature's lane in this group */
    const float (*extent)[8];
    size_t lane;
    uint32_t number;
    /* edges: sdm_feature_group.most of functions 0 and 1 */
    float most[2];
    /* corners: vector from the corner to the centre of the block, scaled */
    float from[3];
} sdm_block_feature;

/* Largest number of features of one kind that pass stages 4 and 5 together; their data fit in the
   L1 cache. */
enum { SDM_BATCH = 24 };

/* A lane reference: 8 * item + lane in 16 bits, for lane `lane` of element `item` of an array; see
   lane_item() in lists.h. Lists of lane references are written eight elements at a time: an array
   needs room for eight more elements than its list has. */
_Static_assert(8 * (8 * SDM_BATCH) <= UINT16_MAX, "lane references must fit into 16 bits");

/* Queue of features of one kind for the next batch. The queue is emptied when n > SDM_BATCH - 8, so
   that the features of one more group always fit. */
typedef struct sdm_pending {
    /* groups of the features, and room for the next group */
    sdm_block_group group[SDM_BATCH + 1];
    /* lane references into group[] */
    uint16_t feature[SDM_BATCH + 8];
    size_t n_group, n;
} sdm_pending;

/* Features of one kind on their way through stages 4 and 5. */
typedef struct sdm_batch {
    sdm_block_feature feature[SDM_BATCH];
    /* values of the region functions at the centres of the vectors of a tile, [tile
       pair][function][vector] */
    _Alignas(64) float at_vectors[8 * SDM_BATCH][8][8];
    /* tile pairs: lane references into feature[]; the lane is the number of a tile that meets the
       feature's region */
    uint16_t tile_pair[8 * SDM_BATCH + 8];
    /* vector pairs: lane references into tile_pair[]; the lane is the number of a vector of this
       tile that meets the feature's region */
    uint16_t vector_pair[64 * SDM_BATCH + 8];
    size_t n_feature, n_tile_pair, n_vector_pair;
} sdm_batch;

/* A feature that may be the nearest one of some voxels of a vector. The candidates of a vector form
   a list, linked from the last one backwards. */
typedef struct sdm_candidate {
    /* number of the feature */
    uint32_t number;
    /* index of the vector's previous candidate; SDM_NONE: this candidate is the first */
    uint32_t before;
    /* bit i: the feature may be the nearest one to voxel i, compared with all candidates found up
       to this one */
    uint32_t voxels;
} sdm_candidate;

/* Candidates of all vectors of the current block; vector v of tile t has index 8 t + v. */
typedef struct sdm_candidates {
    /* squared distances of the nearest and second nearest candidate, [vector][voxel] */
    _Alignas(64) float first[64][8], second[64][8];
    /* number of the nearest candidate, [vector][voxel]; any feature if there is none */
    uint32_t number[64][8];
    /* index of the vector's last candidate in list[]; SDM_NONE: the vector has no candidate */
    uint32_t last[64];
    /* bit i: voxel i lies in the region of a thin face, so its nearest feature cannot be found in
       float */
    uint32_t open[64];
    sdm_candidate *list;
    size_t n, cap;
} sdm_candidates;

/* Clusters (indices of nodes) that may hold the nearest feature of a point of one block. */
typedef struct sdm_cluster_list {
    uint32_t *list;
    size_t n;
} sdm_cluster_list;

struct sdm_grid_scratch {
    /* clusters of the current box: indices of their nodes */
    uint32_t *node;
    /* bit k of node_blocks[i]: node[i] may hold the nearest feature of a point of block k */
    uint8_t *node_blocks;
    /* the same information as one list for each block of the box */
    sdm_cluster_list block[8];
    /* clusters of the current block */
    sdm_cluster_ref *cluster;
    size_t n_cluster, cluster_cap;
    /* features of the current block, [SDM_FEATURE_KINDS] */
    sdm_pending *pending;
    sdm_batch *batch;
    sdm_candidates *candidates;
};

/* Allocates the members of fixed size of a zeroed scratch. The caller ends with
   sdm_grid_scratch_dispose(), also after an error. */
sdm_status sdm_grid_scratch_start(sdm_grid_scratch *scratch, sdm_error *err);

/* Makes room for `cap` clusters of a box. Keeps node[] and node_blocks[], loses the other lists. */
sdm_status sdm_grid_scratch_clusters(sdm_grid_scratch *scratch, size_t cap, sdm_error *err);

/* Makes room for `cap` candidates of a block and keeps those present. SDM_E_NOMEM where the
   scratch for features would take more than `limit` bytes (0: unlimited). */
sdm_status sdm_grid_scratch_candidates(sdm_grid_scratch *scratch, size_t cap, size_t limit,
                                       sdm_error *err);

/* Frees all members and zeroes the scratch. */
void sdm_grid_scratch_dispose(sdm_grid_scratch *scratch);
