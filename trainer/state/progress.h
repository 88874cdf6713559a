/* Time, budget, threads and reports of a run. */
#pragma once

#include "trainer.h"

/* Seconds that the run has taken. After a resume the time up to the checkpoint counts, the time in
 * which the maps were computed again does not. */
double trainer_seconds(const trainer *t);

/* trainer_seconds() of rank 0, on every rank, so that all ranks decide alike. Collective: every
 * rank must call it. */
double trainer_shared_seconds(const trainer *t);

/* Seconds of train.minutes in which the network is trained and measured: all, or all but a tenth if
   a fine level follows. */
double trainer_budget_seconds(const trainer *t);

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

/* Starts to measure the pace of work whose units have `unit_maps` maps each. */
void trainer_pace_start(trainer *t, double unit_maps);

/* Calls the progress callback, at most 10 times a second unless `now`. The rates are those of the
   last seconds: t->pace.done counts the finished units of work. */
void trainer_report(trainer *t, double fraction, bool now);

/* Sends a notice of one line to the message callback. */
void trainer_message(const trainer *t, const char *fmt, ...) SDM_PRINTF(2, 3);

/* Sends a warning of one line to the warning callback, or to the message callback without one. */
void trainer_warn(const trainer *t, const char *fmt, ...) SDM_PRINTF(2, 3);

/* true if the caller wants the run to stop, which rank 0 alone knows, or a rank has ended early.
   [any thread] */
bool trainer_cancelled(const trainer *t);

/* trainer_cancelled() of any rank, on every rank. Collective: every rank must call it. */
bool trainer_all_cancelled(const trainer *t);

/* true: this rank writes the files of the run. */
bool trainer_writes(const trainer *t);

/* true if the held-out maps must be evaluated at time `now` (trainer_seconds()). With a budget of
   time: after one second of a phase, then at intervals that double up to train.evaluate_seconds, or
   so rarely that evaluations take at most a twentieth of the time. Else at the steps 10, 20, 50,
   100 and 200 of a phase and every 500 steps, so that results do not depend on the clock. */
bool trainer_evaluation_due(const trainer *t, double now);

/* true if the evaluation at the present step may choose the weights that are kept (best.h). With a
   budget of steps only every 500th step does. */
bool trainer_evaluation_counts(const trainer *t);

/* Notes the error `mse` (mm^2) on held-out maps, from an evaluation that began at time `began`. */
void trainer_evaluated(trainer *t, double mse, double began);

/* Appends a line with the current figures and the learning rate `rate` to metrics.jsonl. */
sdm_status trainer_metric(trainer *t, double rate, sdm_error *err);

/* Appends a line with the number of ranks; a process that is alone appends none. */
sdm_status trainer_metric_ranks(trainer *t, sdm_error *err);

/* Appends a line with the verdict, without times unless the budget is a time. */
sdm_status trainer_metric_verdict(trainer *t, const sdm_verdict *v, sdm_error *err);

/* Writes metrics.jsonl anew; a trial writes nothing. */
sdm_status trainer_metrics_write(const trainer *t, sdm_error *err);

/* For a training loop: counts a step and reports progress. */
void trainer_step_done(trainer *t);
