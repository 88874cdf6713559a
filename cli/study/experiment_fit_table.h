/* Tables and JSON of the fits of an experiment. */
#pragma once

#include "experiment_fits.h"

/* Errors of one parameter over the fits that converged; NaN: unknown. */
typedef struct cli_experiment_spread {
    double difference; /* mean abs(estimate - estimate of the exact fit) */
    double error;      /* mean abs(estimate - truth) */
    double sd;         /* mean standard deviation */
    double within; /* fraction with abs(estimate - truth) <= 3 sd, without estimates at a bound */
    double reference; /* published difference */
} cli_experiment_spread;
cli_experiment_spread cli_experiment_fit_spread(const cli_experiment_run *run,
                                                const cli_experiment_result *r, size_t param);

/* After all rows: sets the time of rows of the naive engine to (maps of the exact engine's fits) *
 * (time of one naive map); naive fits are not run. */
void cli_experiment_fit_finish(const cli_experiment_run *run);

/* Results by parameter: a second table in Markdown, a list in the JSON of a row, and the files
 * parameters.csv and ROW/fits.csv. */
void cli_experiment_fit_markdown(const cli_experiment_run *run, sdm_text *t);
void cli_experiment_fit_json(const cli_experiment_run *run, const cli_experiment_result *r,
                             sdm_json *j);
sdm_status cli_experiment_fit_write(const cli_experiment_run *run, sdm_error *err);
