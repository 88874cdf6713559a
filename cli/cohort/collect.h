/* The table of the results of a cohort. */
#pragma once

#include "cohort.h"

/* A column of numbers; the groups follow each other in the table. */
typedef enum cli_group {
    CLI_GROUP_PARAM = 0,
    CLI_GROUP_POSE,
    CLI_GROUP_MEASURE,
    CLI_GROUP_OVERLAP,
    CLI_GROUP_EVIDENCE,
    CLI_N_GROUPS
} cli_group;

typedef struct cli_collect_column {
    cli_group group;
    bool is_sd; /* the standard deviation of the column before it */
    char name[100];
} cli_collect_column;

/* The row of a case. */
typedef struct cli_collect_row {
    const char *id;
    cli_case_state state;
    int exit_code;
    char verdict[16];  /* passed, doubtful, failed; "": no estimate */
    char *reason;      /* "": accepted */
    sdm_text outliers; /* "rx 5.2; rz -4", robust standard deviations; NULL: none */
} cli_collect_row;

/* Zero-initialise; cli_collect_dispose() frees. */
typedef struct cli_collect {
    cli_ids ids;
    cli_collect_row *rows;       /* [ids.n] */
    cli_collect_column *columns; /* [n_columns] */
    size_t n_columns;
    double *values; /* [ids.n][n_columns], NaN: none */
} cli_collect;

/* Reads the results in the folder `out`. SDM_E_IO, SDM_E_FORMAT, SDM_E_NOMEM. */
sdm_status cli_collect_read(const char *out, cli_collect *table, sdm_error *err);
void cli_collect_dispose(cli_collect *table);

/* Names the outliers of each row: parameters whose modified z-score, 0.6745 (x - median) / MAD,
 * exceeds 3.5 (Iglewicz and Hoaglin 1993). Median and MAD, the median absolute deviation from it,
 * are those of the accepted fits, of which there must be eight. SDM_E_NOMEM. */
sdm_status cli_collect_outliers(cli_collect *table, sdm_error *err);

/* Appends the table as CSV; adds it as a JSON object. */
void cli_collect_csv(const cli_collect *table, sdm_text *out);
void cli_collect_json(const cli_collect *table, sdm_json *json);

/* Appends the table as an HTML page, which is to be written to `path`: outliers first. It links to
 * the files of the cases in `folder` if it lies there. */
void cli_collect_page(const cli_collect *table, const char *folder, const char *path,
                      sdm_text *out);
