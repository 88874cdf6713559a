/* Moves the maps that the producer has computed into the pool while the network is trained. */
#pragma once

#include "trainer.h"

/* Starts the producer unless all random samples are in the pool. */
sdm_status trainer_samples_start(trainer *t, sdm_error *err);

/* Number of random samples that the pool should hold at `fraction` of a phase: n_start at the
   beginning, all at three quarters. */
size_t trainer_samples_wanted(const trainer *t, double fraction);

/* Takes new samples in groups of SAMPLE_ROUND: with a budget of steps until the pool holds `wanted`
   random samples (waits for them), with a budget of time those that are ready. Returns early when
   the run is cancelled: call trainer_cancelled() before the next step. */
sdm_status trainer_samples_take(trainer *t, size_t wanted, sdm_error *err);

/* Takes the first n_taken random samples again after a resume; waits for them. */
sdm_status trainer_samples_retake(trainer *t, size_t n_taken, sdm_error *err);
