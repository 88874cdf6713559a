/* Time, budget, threads and reports of a run. */
#pragma once

#include "trainer.h"

/* Seconds that the run has taken. After a resume the time up to the checkpoint counts, the time in
 * which the maps were computed again does not. */
double trainer_seconds(const trainer *t);

/* true: the budget is a time (train.minutes). false: it is trainer_steps() optimiser steps. */
bool trainer_by_time(const trainer *t);
int64_t trainer_steps(const trainer *t);

/* Used fraction of the whole budget; may exceed 1. */
double trainer_fraction(const trainer *t);

/* The used fraction while data and bases are computed, before the first step: 0 with a budget of
 * steps. */
double trainer_start_fraction(const trainer *t);

/* Begins a phase: resets its steps and its start time. */
void trainer_enter(trainer *t, sdm_phase phase);

/* Number of threads that compute online samples. */
int trainer_workers(const trainer *t);

/* Number of threads for the training itself: the threads that the producer does not use. */
int trainer_threads(const trainer *t);

/* Calls the progress callback, at most 10 times a second unless `now`. */
void trainer_report(trainer *t, double fraction, double samples_per_second, bool now);

/* Sends a notice of one line to the message callback. */
void trainer_message(trainer *t, const char *fmt, ...) SDM_PRINTF(2, 3);

/* true if the caller wants the run to stop. [any thread] */
bool trainer_cancelled(const trainer *t);

/* true if the held-out maps must be evaluated at time `now` (trainer_seconds()): every
   train.evaluate_seconds with a budget of time, else every 500 steps, so that results do not depend
   on the clock. */
bool trainer_evaluation_due(const trainer *t, double now);

/* Appends a line with the current figures and the learning rate `rate` to metrics.jsonl. */
sdm_status trainer_metric(trainer *t, double rate, sdm_error *err);

/* For a training loop: step and time of its last speed report. */
typedef struct trainer_speed {
    int64_t step;
    double seconds;
} trainer_speed;

trainer_speed trainer_speed_start(const trainer *t);

/* Reports progress and speed if more than half a second has passed since the last report. batch:
   maps trained in a step. */
void trainer_speed_report(trainer *t, trainer_speed *last, size_t batch, double now);
