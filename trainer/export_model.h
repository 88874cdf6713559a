/* From the trained weights to the files of a run: model, resolved config, loss curve. */
#ifndef SDM_TRAINER_EXPORT_H
#define SDM_TRAINER_EXPORT_H

#include "sdm/internal/file.h"
#include "trainer.h"

/* Before the training: refuses texts that a model file has no room for, and takes the checksums of
 * the data files. */
sdm_status export_prepare(trainer *t, sdm_error *err);

/* Appends the resolved configuration, stripped (sdm_config_strip()): the model is the same bits
   wherever and by however many threads it is trained. */
sdm_status export_dump(const trainer *t, sdm_text *out, sdm_error *err);

/* Writes this configuration to a temporary file: config.yaml when the caller commits it. *out is
   the caller's after an error, too (sdm_outfile_discard()). */
sdm_status export_config(const trainer *t, sdm_outfile **out, sdm_error *err);

/* Builds the model from the averaged weights, measures it on the held-out maps as the runtime will
   run it, writes model.sdm and loss.png into the folder and fills the report (may be NULL). */
sdm_status export_model(trainer *t, sdm_train_report *report, sdm_error *err);

/* Seconds that export_model() will take, by measuring one map. */
sdm_status export_time(trainer *t, double *seconds, sdm_error *err);

#endif
