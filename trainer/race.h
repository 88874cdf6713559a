/* The choice of the kinds of network to train (network.kind: auto) by short trials on the shape's
   own maps. */
#pragma once

#include "look.h"

/* What a trial hands on to the training of its kind. */
typedef struct trial_gain {
    void *design; /* trainer.design; NULL: none */
    dataset maps; /* trainer.tried */
} trial_gain;

/* Numbers of the maps of a trial, for training and held out. */
size_t trainer_trial_maps(const sdm_config *c, size_t n_params);
int64_t trainer_trial_holdout(const sdm_config *c);

/* Fills *out with the kinds to train. Each kind that the shape allows is trained on the same few
   hundred exact maps (bases and least squares, no steps) and measured on held-out shapes; the
   results are sent to the message callback and appended to t->metrics. gain[i] = what the trial of
   out->kind[i] hands on; the caller owns the maps also after an error. The choice depends on
   configuration, shape and seed only; with a budget of time that ends before all maps of the trials
   are made, on the machine, too. t: config, shape, folder, hooks, n_threads and started are set;
   scratch: memory for a configuration. SDM_E_CANCELLED and the errors of a training. */
sdm_status trainer_race(trainer *t, sdm_config *scratch, training_turns *out, trial_gain gain[2],
                        sdm_error *err);
