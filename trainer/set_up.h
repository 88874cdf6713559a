/* The beginning of a run: kind of network, shape, grid, memory for the maps. */
#pragma once

#include "state/kind.h"

/* The functions of a kind of network, not SDM_NETWORK_AUTO. */
const train_kind *trainer_kind_find(sdm_network_kind kind);

/* Checks the shape against the configuration, lets the kind prepare, allocates the data set and the
   blocks of its maps. config, shape, kind, hooks and n_threads of *t must be set. */
sdm_status trainer_set_up(trainer *t, sdm_error *err);

/* Refuses a grid without a voxel inside any held-out shape: a network trained on it would have a
   small error but be useless. Call after the held-out maps have been made. */
sdm_status trainer_check_grid(const trainer *t, sdm_error *err);
