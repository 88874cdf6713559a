/* Checkpoints: the file checkpoint.sdmc, from which a run continues with the same bits. */
#pragma once

#include "trainer.h"

/* Removes checkpoint and models of an older run from the folder. */
sdm_status trainer_checkpoint_clear_folder(const trainer *t, sdm_error *err);

/* Removes the checkpoint of a finished run. */
sdm_status trainer_checkpoint_remove(const trainer *t, sdm_error *err);

/* Writes the checkpoint atomically. */
sdm_status trainer_checkpoint_write(trainer *t, sdm_error *err);

/* Writes a checkpoint if the last one is older than train.checkpoint_seconds at time `now`. If it
 * cannot be written, a warning tells it, and the next time is as far away as after a written one.
 */
void trainer_checkpoint_if_due(trainer *t, double now);

/* *out = the kinds that the run trains whose checkpoint is in the folder of t, and where it was.
 *found: false if there is no checkpoint. SDM_E_FORMAT: it is damaged. */
sdm_status trainer_checkpoint_turns(const trainer *t, training_turns *out, bool *found,
                                    sdm_error *err);

/* Tells that a run that was to go on starts from the beginning. */
void trainer_tell_no_checkpoint(const trainer *t);

/* First half of reading, before the maps are made: checks the configuration, restores counters,
   times, sample plan and metrics. t->data.n_taken becomes the number of random samples that the
   caller has to make again. *found: false if there is no checkpoint. SDM_E_CONFIG: the
   checkpoint belongs to another configuration or has used more than the budget. SDM_E_FORMAT: it
   is damaged. */
sdm_status trainer_checkpoint_read(trainer *t, bool *found, sdm_error *err);

/* Second half, after train_kind.begin(): restores weights, moments and averages of
   train_kind.weights(). SDM_E_CONFIG: the maps differ from those of the interrupted run. */
sdm_status trainer_checkpoint_weights(trainer *t, sdm_error *err);

/* Writes a checkpoint and returns SDM_E_CANCELLED, or the error of the writing. */
sdm_status trainer_stop(trainer *t, sdm_error *err);
