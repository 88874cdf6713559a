/* sdmgen experiment: rows of a table, each a method that is trained or loaded, measured, drawn. */
#ifndef CLI_EXPERIMENT_H
#define CLI_EXPERIMENT_H

#include "args/options.h"
#include "evaluate.h"
#include "sdm/internal/experiment.h"
#include "sdm/registry.h"

typedef enum experiment_state {
    EXPERIMENT_PLANNED = 0,
    EXPERIMENT_DONE,
    EXPERIMENT_MISSING, /* this build or machine cannot do it */
    EXPERIMENT_FAILED
} experiment_state;

/* What a row that fits shapes to images found: experiment_fit.h. */
typedef struct experiment_fits experiment_fits;

/* What is known of a row. */
typedef struct experiment_result {
    const sdm_experiment_row *row;
    experiment_state state;
    bool loaded;                  /* the network was there already */
    double figure[SDM_N_FIGURES]; /* NaN: not measured */
    experiment_fits *fits;        /* NULL: no row of fits */
    char note[512];               /* what was done, or why not; one line */
    char grid[96];                /* "60 x 50 x 50 voxels of 0.2 mm" */
} experiment_result;

/* A row's training configuration with its shape, ready to be measured. */
typedef struct experiment_job {
    size_t index;
    sdm_config *config;
    sdm_instance *shape;
    cli_map_maker maker;            /* without `make` until there is a method */
    double nominal[SDM_MAX_PARAMS]; /* the shape's defaults within the ranges: the shape that is
                                       drawn */
    sdm_error why;                  /* status of experiment_job_open(), and its message */
} experiment_job;

typedef struct experiment_run {
    const cli_args *args;
    const sdm_experiment *e;
    const sdm_registry *registry;
    const char *folder;
    experiment_result *results; /* [e->n_rows] */
    experiment_job *jobs;       /* [e->n_rows] */
    double start;               /* sdm_clock() */
} experiment_run;

/* *job is zero-initialised; experiment_job_close() frees it in every case, once or more. The status
 * is that of job->why. */
sdm_status experiment_job_open(const experiment_run *run, size_t index, experiment_job *job);
void experiment_job_close(experiment_job *job);

/* Path of something of a row: FOLDER/ROW/NAME. SDM_E_ARG: too long. */
sdm_status experiment_path(const experiment_run *run, size_t index, const char *name,
                           char path[SDM_PATH_TEXT_MAX], sdm_error *err);

/* Where the network of a row is, as far as it is there: the model of this very configuration, or a
 * checkpoint to go on from. */
typedef enum experiment_stock {
    STOCK_NONE = 0,
    STOCK_OTHER,
    STOCK_CHECKPOINT,
    STOCK_MODEL
} experiment_stock;
experiment_stock experiment_find(const experiment_run *run, const experiment_job *job);

/* Trains the network of a row, goes on, or finds it done: then its model is there. */
sdm_status experiment_provide(const experiment_run *run, const experiment_job *job,
                              experiment_result *out, sdm_error *err);

/* Fill the figures of *out and draw; the status is that of the row. */
sdm_status experiment_network(const experiment_run *run, experiment_job *job,
                              experiment_result *out, sdm_error *err);
sdm_status experiment_engine(const experiment_run *run, experiment_job *job, experiment_result *out,
                             sdm_error *err);

/* Whether there is an engine of that name: "" when there is, else a text for a message, "'exakt' is
 * no engine; did you mean ...". */
sdm_status experiment_check_engine(const char *name, sdm_error *err);

/* Slices exact | method | error and the zero surfaces, of the map values[nz][ny][nx] at
   job->nominal; does nothing where pictures are not wanted. A surface that is missing is left out.
 */
sdm_status experiment_draw(const experiment_run *run, const experiment_job *job,
                           const float *values, sdm_error *err);

/* Figures of errors, of one map or over all shapes. */
void experiment_set_errors(experiment_result *out, const cli_eval *e);

/* table.md, table.csv and table.json in the folder; the first and the last also as texts. */
sdm_status experiment_write_tables(const experiment_run *run, sdm_text *markdown, sdm_json *json,
                                   sdm_error *err);

/* The parts of tables: a text as NAME in the folder, as a cell in Markdown, in quotes for CSV. */
sdm_status experiment_write_file(const experiment_run *run, const char *name, const sdm_text *text,
                                 sdm_error *err);
void experiment_add_cell(sdm_text *t, const char *text);
void experiment_add_csv_text(sdm_text *t, const char *text);

/* What will be done, and how long the trainings take. */
sdm_status experiment_print_plan(const experiment_run *run, sdm_error *err);

/* A line of FOLDER/log.txt with the seconds since the start, also a notice on stderr. */
void experiment_log(const experiment_run *run, const char *fmt, ...) SDM_PRINTF(2, 3);

/* The first lines of a log: version, command, seeds, time. */
void experiment_log_start(const experiment_run *run);

/* "Linux 6.1 x86_64, NAME OF THE PROCESSOR, 2 cores, 8 GB". */
void experiment_describe_machine(char *buf, size_t size);

#endif
