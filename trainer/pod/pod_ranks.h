/* Shares the trees (pod_tree.h) of a `pod` network among ranks: each rank has consecutive trees,
   and so consecutive blocks, voxels, bases and coefficients on each level. Letters as in
   pod_state.h. */
#pragma once

#include "pod_state.h"

/* The trees of this rank, first .. end - 1, numbered from 0. */
typedef struct pod_share {
    size_t first, end;
} pod_share;

pod_share trainer_pod_share(const pod_state *pod);

/* train_kind.shares: the voxels of the trees of each rank. */
void trainer_pod_shares(trainer *t, size_t *share);

/* First block of `level` in the trees from number `tree` on; with the number of trees, the end of
   the level. */
size_t trainer_pod_first_block(const pod_state *pod, size_t level, size_t tree);

/* Index of the first element of block b in an array, of one level or of all; for the end of a level
   the number of elements up to there. */
typedef size_t pod_place(const pod_state *pod, size_t b);

pod_place trainer_pod_place_block;       /* one element for each block of all levels */
pod_place trainer_pod_place_root;        /* the same for the highest level alone: a tree */
pod_place trainer_pod_place_voxel;       /* [n_voxels], lowest level */
pod_place trainer_pod_place_matrix;      /* pod->basis */
pod_place trainer_pod_place_coefficient; /* [K], highest level */

/* Gives all ranks the elements of data that belong to blocks of `level`, each from the rank that
   has the block's tree. bytes: of an element. */
sdm_status trainer_pod_gather(const pod_state *pod, size_t level, pod_place *place, size_t bytes,
                              void *data, sdm_error *err);

/* The same for columns: y[n][K], coefficients of the highest level. */
sdm_status trainer_pod_gather_columns(const pod_state *pod, size_t n, float *y, sdm_error *err);
