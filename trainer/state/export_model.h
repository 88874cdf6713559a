/* Writes the results of a run: model file with its measured accuracy, configuration, loss curve. */
#pragma once

#include "sdm/internal/file.h"
#include "trainer.h"

/* Call before the training: refuses names, units and option values that a model file has no room
   for, and computes the checksums of the shape's data files. */
sdm_status trainer_export_prepare(trainer *t, sdm_error *err);

/* Appends the configuration with all defaults filled in to *out, stripped of paths and thread
   counts (sdm_config_strip()), so that the model file has the same bits wherever it is trained. */
sdm_status trainer_export_dump(const trainer *t, sdm_text *out, sdm_error *err);

/* Writes this configuration to a temporary file, which becomes config.yaml when the caller commits
 *out. The caller owns *out even after an error: sdm_outfile_discard(). */
sdm_status trainer_export_config(const trainer *t, sdm_outfile **out, sdm_error *err);

/* path = that of model.sdm in the folder of the run. */
void trainer_export_path(const trainer *t, char path[SDM_PATH_TEXT_MAX]);

/* Builds the model from the averaged weights, measures it on the held-out maps exactly as the
   runtime will run it, adds its error and its verdict to the metrics and fills *report.
   SDM_E_QUALITY: the network gives numbers that are not finite. */
sdm_status trainer_export_judge(trainer *t, sdm_train_report *report, sdm_error *err);

/* Writes model.sdm, with the accuracy that trainer_export_judge() has measured, and loss.png. */
sdm_status trainer_export_model(const trainer *t, sdm_error *err);

/* Writes the model alone, under another name. */
sdm_status trainer_export_to(const trainer *t, const char *path, sdm_error *err);

/* *out = errors of the model with the present averaged weights on all held-out shapes;
   *rmse_voxel_mm = root mean square error of the voxels within a voxel of the surface; *map_ms =
   processor time of a map. Writes nothing. */
sdm_status trainer_export_measure(const trainer *t, sdm_accuracy *out, double *rmse_voxel_mm,
                                  double *map_ms, sdm_error *err);

/* *seconds = expected duration of the measurement in trainer_export_model(), from one map. */
sdm_status trainer_export_time(trainer *t, double *seconds, sdm_error *err);
