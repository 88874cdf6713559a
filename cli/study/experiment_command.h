/* Experiments: each row of the table is a method that is trained or loaded, measured and drawn. */
#pragma once

#include "args/options.h"
#include "evaluate.h"
#include "sdm/internal/experiment.h"
#include "sdm/registry.h"

typedef enum cli_experiment_state {
    CLI_EXPERIMENT_PLANNED = 0,
    CLI_EXPERIMENT_DONE,
    CLI_EXPERIMENT_MISSING, /* this build or machine lacks the method */
    CLI_EXPERIMENT_FAILED
} cli_experiment_state;

/* The fits of a row that fits shapes to images; see experiment_fit.h. */
typedef struct cli_experiment_fits cli_experiment_fits;

/* The result of a row. */
typedef struct cli_experiment_result {
    const sdm_experiment_row *row;
    cli_experiment_state state;
    bool loaded;                  /* the network existed and was not trained */
    double figure[SDM_N_FIGURES]; /* NaN: not measured */
    cli_experiment_fits *fits;    /* NULL: the row has no fits */
    char note[512];               /* one line: the method and its conditions, or why it failed */
    char grid[96];                /* "60 x 50 x 50 voxels of 0.2 mm" */
} cli_experiment_result;

/* The training configuration and the shape of a row. */
typedef struct cli_experiment_job {
    size_t index; /* index of the row */
    sdm_config *config;
    sdm_instance *shape;
    cli_map_maker maker; /* `make` is NULL until the method is ready */
    double
        nominal[SDM_MAX_PARAMS]; /* parameters of the drawn shape: defaults clamped to the ranges */
    sdm_error open_error;        /* status and message of cli_experiment_job_open() */
} cli_experiment_job;

typedef struct cli_experiment_run {
    const cli_args *args;
    const sdm_experiment *e;
    const sdm_registry *registry;
    const char *folder;             /* folder of all outputs */
    cli_experiment_result *results; /* [e->n_rows] */
    cli_experiment_job *jobs;       /* [e->n_rows] */
    double start;                   /* sdm_clock() at the start, s */
} cli_experiment_run;

/* Prepares the job of row `index`. Zero-initialise *job; cli_experiment_job_close() frees it, also
 * after an error, and may be called again. Returns job->open_error.status. */
sdm_status cli_experiment_job_open(const cli_experiment_run *run, size_t index,
                                   cli_experiment_job *job);
void cli_experiment_job_close(cli_experiment_job *job);

/* path = FOLDER/ROW/NAME; FOLDER/ROW if name is "". SDM_E_ARG: too long. */
sdm_status cli_experiment_path(const cli_experiment_run *run, size_t index, const char *name,
                               char path[SDM_PATH_TEXT_MAX], sdm_error *err);

/* Writes the text to FOLDER/NAME. SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_experiment_write_file(const cli_experiment_run *run, const char *name,
                                     const sdm_text *text, sdm_error *err);

/* Files of an earlier training in the folder of a row. */
typedef enum cli_experiment_stored {
    CLI_STORED_NONE = 0,
    CLI_STORED_OTHER,      /* a model or checkpoint of another configuration */
    CLI_STORED_CHECKPOINT, /* a checkpoint of the same configuration */
    CLI_STORED_MODEL       /* the finished model of the same configuration */
} cli_experiment_stored;
cli_experiment_stored cli_experiment_find_stored(const cli_experiment_run *run,
                                                 const cli_experiment_job *job);

/* With network.kind: auto; other kinds: does nothing. Before a training starts: removes model and
 * checkpoint of an earlier one and writes asked.yaml, the configuration as the row states it, to
 * the folder of the row; after the training: marks it as finished. SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_experiment_begin_asked(const cli_experiment_run *run, const cli_experiment_job *job,
                                      sdm_error *err);
sdm_status cli_experiment_end_asked(const cli_experiment_run *run, const cli_experiment_job *job,
                                    sdm_error *err);

/* Provides model.sdm in the folder of the row: if it does not exist, starts or continues the
 * training. SDM_E_QUALITY: the training would exceed experiment.minutes. Also returns errors of the
 * training. */
sdm_status cli_experiment_provide_model(const cli_experiment_run *run,
                                        const cli_experiment_job *job, cli_experiment_result *out,
                                        sdm_error *err);

/* Measure a row with a network, or with a method or program that needs no training: fill the
 * figures and the note of *out and draw the pictures. Return the status of the row. */
sdm_status cli_experiment_network(const cli_experiment_run *run, cli_experiment_job *job,
                                  cli_experiment_result *out, sdm_error *err);
sdm_status cli_experiment_engine(const cli_experiment_run *run, cli_experiment_job *job,
                                 cli_experiment_result *out, sdm_error *err);

/* Checks that a method or peer of that name exists. SDM_E_CONFIG with all names and "did
 * you mean". */
sdm_status cli_experiment_check_engine(const char *name, sdm_error *err);

/* Draws slices exact | method | error and the zero level set of the map values[nz][ny][nx] at
 * job->nominal, unless pictures are switched off. Without a zero surface surfaces.png is
 * omitted. */
sdm_status cli_experiment_draw(const cli_experiment_run *run, const cli_experiment_job *job,
                               const float *values, sdm_error *err);

/* Copies the errors, of one map or over all shapes, to the figures of *out. */
void cli_experiment_set_errors(cli_experiment_result *out, const cli_eval *e);

/* Writes table.md, table.csv and table.json, and the files of the fits, to the folder. *markdown
 * and *json receive the texts of table.md and table.json. */
sdm_status cli_experiment_write_tables(const cli_experiment_run *run, sdm_text *markdown,
                                       sdm_json *json, sdm_error *err);

/* Prints the planned action of every row and the duration of the trainings. */
sdm_status cli_experiment_print_plan(const cli_experiment_run *run, sdm_error *err);

/* Appends a line to FOLDER/log.txt, with the seconds since the start; also prints it as a
 * notice. */
void cli_experiment_log(const cli_experiment_run *run, const char *fmt, ...) SDM_PRINTF(2, 3);

/* Appends the head of a log: date, version, machine, settings and command. */
void cli_experiment_log_start(const cli_experiment_run *run);

/* buf[size] = "NAME OF THE PROCESSOR, 2 cores, Linux x86_64". */
void cli_experiment_describe_machine(char *buf, size_t size);
