/* The training of one kind of network from beginning to end. */
#pragma once

#include "state/trainer.h"

/* Trains the network of t->config, writes its files into t->folder and fills *report. t: config,
   shape, folder, hooks, n_threads, started, metrics and turns are set, and design and tried where a
   trial hands them on; everything else is zero, or NaN. The second training of a run (turns.h)
   writes model and configuration only if it wins. resume: as sdm_train(). Frees all that t holds.
   *unfit: true if the error means that this kind cannot be trained as configured, and nothing is
   lost without it: the set-up or the maps of a new training fail (not if it is cancelled), or the
   network gives numbers that are not finite (SDM_E_QUALITY). */
sdm_status trainer_training(trainer *t, bool resume, bool *unfit, sdm_train_report *report,
                            sdm_error *err);
