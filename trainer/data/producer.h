/* Worker threads that compute random training maps in the background while the caller trains. Ranks
   (sdm/internal/comm.h) take turns: sample i is made by rank i mod size, and the others get it when
   it is taken. */
#pragma once

#include "dataset.h"

typedef struct producer producer;

/* Starts n_threads workers, which compute the random samples of d in order from `first` on: only
   samples that are planned (d->plan), and at most 64 samples ahead of the samples taken. d must
   outlive the workers. */
sdm_status trainer_producer_start(dataset *d, size_t first, int n_threads, producer **out,
                                  sdm_error *err);

/* Lets the workers compute the samples below n_planned, whose points are in d->plan. */
void trainer_producer_allow(producer *p, size_t n_planned);

/* Number of finished samples that can be taken now without waiting. Collective: every rank
   must call it. */
size_t trainer_producer_ready(producer *p);

/* Moves finished samples into the pool until it holds `until` random samples; waits for unfinished
   ones. Returns the error of the first sample that failed. Collective: every rank must call it. */
sdm_status trainer_producer_take(producer *p, size_t until, sdm_error *err);

/* Stops the workers and frees the producer; NULL does nothing. */
void trainer_producer_stop(producer *p);
