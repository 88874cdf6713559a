/* Rows of an experiment that fit shapes to test images with known truth (phantoms). */
#pragma once

#include "experiment_fits.h"

/* Fits all phantoms and fills the figures of *out. A row of the naive method only times its maps;
 * cli_experiment_fit_finish() derives its figures. */
sdm_status cli_experiment_fit_row(const cli_experiment_run *run, cli_experiment_job *job,
                                  cli_experiment_result *out, sdm_error *err);

/* NULL is allowed. */
void cli_experiment_fits_free(cli_experiment_fits *f);
