/* Answers at points: the columns of --columns, and the output file. */
#pragma once

#include "args/options.h"
#include "sdm/exact.h"

/* Columns of the table of answers, in the order of --columns. */
typedef struct cli_points_table {
    int column[4]; /* indices of the columns' kinds */
    int n_columns;
    sdm_exact_at at; /* arrays for n points; NULL for an array that no column needs */
    size_t n;
} cli_points_table;

/* Checks --columns, the outputs and other options of `exact --points`, and fills the columns.
 * SDM_E_ARG. */
sdm_status cli_points_check(const cli_args *args, cli_points_table *t, sdm_error *err);

/* The same for `generate --points`, whose columns are distance and gradient. */
sdm_status cli_points_check_model(const cli_args *args, cli_points_table *t, sdm_error *err);

/* Allocates the arrays of t->at for n points. cli_points_dispose() frees them. SDM_E_NOMEM. */
sdm_status cli_points_allocate(cli_points_table *t, size_t n, sdm_error *err);
void cli_points_dispose(cli_points_table *t);

/* Writes the table to all outputs: .csv with a header line and the points x[n][3] in the first
 * columns, .npy as float64 [n][columns]. The answer at a point that has none is empty (.csv) or
 * NaN. */
sdm_status cli_points_write(const cli_points_table *t, const double *x, const cli_args *args,
                            sdm_error *err);
