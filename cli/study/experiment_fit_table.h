/* Tables and JSON of the fits of an experiment. */
#pragma once

#include "experiment_fits.h"

/* After all rows: sets the time of rows of the naive engine to (maps of the exact engine's fits) *
 * (time of one naive map); naive fits are not run. */
void cli_experiment_fit_finish(const cli_experiment_run *run);

/* Results by parameter: a second table in Markdown, a list in the JSON of a row, and the files
 * parameters.csv and ROW/fits.csv. */
void cli_experiment_fit_markdown(const cli_experiment_run *run, sdm_text *t);
void cli_experiment_fit_json(const cli_experiment_run *run, const cli_experiment_result *r,
                             sdm_json *j);
sdm_status cli_experiment_fit_write(const cli_experiment_run *run, sdm_error *err);
