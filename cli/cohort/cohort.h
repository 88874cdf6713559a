/* Fits of many cases: a table with a row for each case, a folder for each case's results, and
 * leases with which several processes share the cases. */
#pragma once

#include "args/options.h"
#include "csv_cells.h"
#include "sdm/internal/config.h"
#include "sdm/internal/sha256.h"

/* Files in the folder of a cohort and in the folder of a case. */
#define CLI_COHORT_LIST "cohort.json" /* the ids of the cases, in the order of the table */
#define CLI_COHORT_FAILED "failed.csv"
#define CLI_CASE_FIT "fit.json"
#define CLI_CASE_RECORD "case.json"
#define CLI_CASE_LOG "log.txt"
#define CLI_CASE_LEASE "lease"

enum { CLI_CASE_PATH_MAX = SDM_PATH_TEXT_MAX + 300, CLI_CASE_ID_MAX = 100 };

/* ---- the table (cohort_table.c) ---- */

typedef enum cli_column_kind {
    CLI_COLUMN_OPTION = 0, /* an option of `fit` */
    CLI_COLUMN_ID,
    CLI_COLUMN_IMAGE,
    CLI_COLUMN_MODEL
} cli_column_kind;

typedef struct cli_column {
    cli_column_kind kind;
    const cli_option *option; /* CLI_COLUMN_OPTION, else NULL */
} cli_column;

typedef struct cli_cohort {
    const cli_args *args;         /* the command line */
    const char *csv;              /* the table */
    char base[CLI_CASE_PATH_MAX]; /* its folder with a slash, "" for the current one */
    char out[SDM_PATH_TEXT_MAX];  /* the folder of the results, without a slash at its end */
    cli_cells cells;              /* one row a case */
    cli_column *columns;          /* [cells.n_columns] */
} cli_cohort;

/* Reads the table of --cases and checks its columns and ids. The first -o is the folder of the
 * results. SDM_E_ARG; SDM_E_FORMAT with file and line; SDM_E_IO. cli_cohort_dispose() frees, also
 * after an error. */
sdm_status cli_cohort_read(const cli_args *args, cli_cohort *out, sdm_error *err);
void cli_cohort_dispose(cli_cohort *c);

/* Id of case i of cells.n_rows. */
const char *cli_cohort_id(const cli_cohort *c, size_t i);

/* SDM_E_FORMAT unless the id can be the name of a folder on every file system. */
sdm_status cli_check_id(const char *id, sdm_error *err);

/* path = "FOLDER/ID" or, with a name, "FOLDER/ID/NAME". */
void cli_case_path(const char *folder, const char *id, const char *name,
                   char path[CLI_CASE_PATH_MAX]);

/* ---- the command line of one case (cohort_words.c) ---- */

/* Zero-initialise; cli_words_dispose() frees. */
typedef struct cli_words {
    char **argv; /* [argc] the command line of the fit */
    int argc, capacity;
    sdm_text settings; /* what decides the result, as written in the table: a line per option */
    cli_list inputs;   /* items of argv, or their ends, that name files which the fit reads */
    cli_list outputs;  /* file names in the folder of the case that the fit writes */
} cli_words;

/* Makes the command line of a fit of case i: the options of the command line, replaced by those of
 * the row. Relative paths in the row start from the folder of the table, outputs go to the folder
 * of the case. SDM_E_FORMAT, SDM_E_NOMEM. */
sdm_status cli_words_make(const cli_cohort *c, size_t i, cli_words *out, sdm_error *err);
void cli_words_dispose(cli_words *w);

/* key = a hash of all that decides the result of a fit: version of the program, settings, content
 * of the input files. A file that cannot be read counts as such: a fit will tell. SDM_E_NOMEM. */
sdm_status cli_words_key(const cli_words *w, char key[SDM_SHA256_TEXT], sdm_error *err);

/* Checks the values of all cases without opening their files (cohort_check.c). SDM_E_FORMAT with
 * file and line. */
sdm_status cli_cohort_check(const cli_cohort *c, sdm_error *err);

/* ---- the record of a case (cohort_record.c) ---- */

typedef enum cli_case_state {
    CLI_CASE_MISSING = 0, /* no fit of this case came to its end, or its files are damaged */
    CLI_CASE_ACCEPTED,
    CLI_CASE_REFUSED, /* the verdict of the fit is that its result must not be trusted */
    CLI_CASE_FAILED   /* no fit: bad input, a crash */
} cli_case_state;

/* The end of the fit of a case. */
typedef struct cli_case_end {
    cli_case_state state;
    int exit_code; /* as that of a single fit; 128 + N: ended by signal N */
    char key[SDM_SHA256_TEXT];
    char reason[SDM_ERROR_TEXT_MAX]; /* "" for an accepted fit */
    double seconds;                  /* wall time */
} cli_case_end;

/* "missing", "accepted", "refused" or "failed". */
const char *cli_case_state_name(cli_case_state state);

/* Writes the record of a case with checksums of those of its files that exist: fit.json and
 * `outputs`. SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_record_write(const char *out, const char *id, const cli_case_end *end,
                            const cli_list *outputs, sdm_error *err);

/* Reads the record of a case, all but the time. state CLI_CASE_MISSING: there is none or, with
 * `check`, one of its files is not as it was written. */
void cli_record_read(const char *out, const char *id, bool check, cli_case_end *end);

/* Before a fit: removes the record of an earlier one, its files and temporary files. */
void cli_record_remove(const char *out, const char *id, const cli_list *outputs);

/* After a fit that was stopped: removes its temporary files. */
void cli_record_sweep(const char *out, const char *id);

/* ---- leases (lease.c) ---- */

/* The right to work on a case: a file in its folder, with host, process and time. */
typedef struct cli_lease {
    char path[CLI_CASE_PATH_MAX]; /* without its number */
    unsigned number;              /* 0: none is held */
    double renewed;               /* sdm_clock() */
} cli_lease;

/* Takes the lease of the case in `folder`. *holder: "" when it is taken; else who has it. A lease
 * is taken over at once when its process on this host is dead, else when it was not renewed for
 * three minutes. Safe between hosts on NFS. SDM_E_IO. */
sdm_status cli_lease_take(const char *folder, cli_lease *lease, char holder[200], sdm_error *err);

/* Call it at least every ten seconds: renews the lease twice a minute. */
void cli_lease_renew(cli_lease *lease);

/* Gives the lease back. finished: the record of the case is in place. */
void cli_lease_release(cli_lease *lease, bool finished);

/* ---- the run (cohort_child.c, cohort_run.c) ---- */

/* Runs one fit as `sdmgen fit` does, and writes its JSON to `json` also where its verdict is that
 * it must not be trusted. */
typedef sdm_status cli_cohort_fit(const cli_args *args, const char *json, sdm_error *err);

/* Runs the fit of a case in a child process, so that a crash ends this case alone; its output goes
 * to log.txt in `folder`. Renews the lease meanwhile. SDM_E_CANCELLED after an interrupt: the fit
 * is abandoned. */
sdm_status cli_cohort_child(const cli_words *w, const char *folder, cli_cohort_fit *fit,
                            cli_lease *lease, cli_case_end *end, sdm_error *err);

/* Fits the cases of --part, or all. Fails with exit code 6 when a case failed, and with exit code
 * 130 after an interrupt. */
sdm_status cli_cohort_run(const cli_args *args, cli_cohort_fit *fit, sdm_error *err);

/* ---- the list of the cases (cohort_list.c) ---- */

/* Writes cohort.json, the list of the ids, unless it is there. */
sdm_status cli_cohort_list_write(const cli_cohort *c, sdm_error *err);

/* The ids of a cohort; cli_ids_dispose() frees. */
typedef struct cli_ids {
    char (*id)[CLI_CASE_ID_MAX + 1];
    size_t n;
} cli_ids;

/* Reads the list in the folder `out`. SDM_E_IO: there is none; SDM_E_FORMAT. */
sdm_status cli_cohort_list_read(const char *out, cli_ids *ids, sdm_error *err);
void cli_ids_dispose(cli_ids *ids);

/* Writes failed.csv, a row for each case of the list whose fit failed, or removes it if there is
 * none. SDM_E_IO, SDM_E_NOMEM. */
sdm_status cli_cohort_write_failed(const char *out, const cli_ids *ids, sdm_error *err);
