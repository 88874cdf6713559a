/* Moves training maps between ranks that keep only a part of the voxels of each (dataset.share). */
#pragma once

#include "dataset.h"

/* Each rank r with slots[r] != SIZE_MAX sends its map[n_voxels]; every rank puts its voxels of it
   into slots[r]. map: NULL on a rank that sends none; slots[ranks]: the same on all ranks. */
sdm_status trainer_dataset_spread(dataset *d, const int16_t *map, const size_t *slots,
                                  sdm_error *err);

/* map[n_voxels] = the map in `slot`, of which every rank may have its part. Collective: every rank
   must call it. */
sdm_status trainer_dataset_whole(const dataset *d, size_t slot, int16_t *map, sdm_error *err);
