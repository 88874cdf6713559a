/* Computes the maps that are needed before training: held-out, static grid, first random ones. */
#pragma once

#include "dataset.h"

/* Random maps that are made even if fill_hooks.enough() is true, as far as n_start asks for them.
 */
enum { FILL_LEAST_RANDOM = 128 };

/* Callbacks of trainer_dataset_fill(); each may be NULL. */
typedef struct fill_hooks {
    /* Called on the thread that called trainer_dataset_fill(); `done` of `all` maps are
     * finished. */
    void (*report)(void *user, size_t done, size_t all);
    bool (*cancelled)(void *user);
    /* true: the remaining maps of n_start are left to be made during training; n_start and n_online
       change accordingly. */
    bool (*enough)(void *user);
    void *user;
} fill_hooks;

/* Makes all maps needed before training: held-out, static, start. shape, grid, blocks, n_blocks,
   min, max, distribution and seed must be set. */
sdm_status trainer_dataset_fill(dataset *d, int n_threads, const fill_hooks *hooks, sdm_error *err);
