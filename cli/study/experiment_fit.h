/* Rows of an experiment that fit shapes to test images with known truth (phantoms). */
#ifndef CLI_EXPERIMENT_FIT_H
#define CLI_EXPERIMENT_FIT_H

#include "experiment_command.h"
#include "sdm/pose.h"

/* A test image with its truth and the start of a fit. Zero-initialise;
 * cli_experiment_phantom_dispose() frees. */
typedef struct cli_experiment_phantom {
    double truth[SDM_MAX_PARAMS], start[SDM_MAX_PARAMS]; /* parameters */
    sdm_pose pose, start_pose;                           /* true pose, start pose */
    sdm_grid grid;
    float *values;  /* [nz][ny][nx] HU */
    uint8_t *label; /* [nz][ny][nx] 1 inside, 0 outside */
} cli_experiment_phantom;

/* Makes phantom `index` of the experiment. It is the same for all methods whose shapes have the
 * same ranges. SDM_E_ARG: fit.voxel is too small. */
sdm_status cli_experiment_phantom_make(const cli_experiment_run *run, const cli_experiment_job *job,
                                       size_t index, cli_experiment_phantom *out, sdm_error *err);
void cli_experiment_phantom_dispose(cli_experiment_phantom *p);

/* The fit of a method to one phantom. found and sd are NaN unless it converged. */
typedef struct cli_experiment_fit {
    bool converged;
    bool at_bound[SDM_MAX_PARAMS]; /* the estimate is at an end of its range */
    double truth[SDM_MAX_PARAMS], found[SDM_MAX_PARAMS], sd[SDM_MAX_PARAMS];
    double seconds, dice;
    size_t maps_network, maps_exact; /* maps that each source made */
} cli_experiment_fit;

struct cli_experiment_fits {
    size_t n, n_params;
    char name[SDM_MAX_PARAMS][SDM_NAME_MAX], unit[SDM_MAX_PARAMS][16];
    cli_experiment_fit *fit; /* [n] */
};

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

/* Fits all phantoms and fills the figures of *out. A row of the naive method only times its maps;
 * cli_experiment_fit_finish() derives its figures. */
sdm_status cli_experiment_fit_row(const cli_experiment_run *run, cli_experiment_job *job,
                                  cli_experiment_result *out, sdm_error *err);

/* After all rows: sets the time of naive rows to what the exact fits would take with naive maps. */
void cli_experiment_fit_finish(const cli_experiment_run *run);

/* Results by parameter: a second table in Markdown, a list in the JSON of a row, and the files
 * parameters.csv and ROW/fits.csv. */
void cli_experiment_fit_markdown(const cli_experiment_run *run, sdm_text *t);
void cli_experiment_fit_json(const cli_experiment_run *run, const cli_experiment_result *r,
                             sdm_json *j);
sdm_status cli_experiment_fit_write(const cli_experiment_run *run, sdm_error *err);

/* NULL is allowed. */
void cli_experiment_fits_free(cli_experiment_fits *f);

#endif
