/* Answers at points: the columns of --columns, and the output file. */
#pragma once

#include "args/options.h"
#include "sdm/exact.h"
#include "sdm/shape.h"

/* Columns of the table of answers, in the order of --columns. */
typedef struct cli_points_table {
    int column[5]; /* indices of the columns' kinds */
    int n_columns;
    bool wants_slopes; /* for the column slopes or --jacobian */
    bool needs_all;    /* exact slopes need all arrays of `at` */
    sdm_exact_at at;   /* arrays for n points; NULL for an array that is not needed */
    double *slopes;    /* [n][n_params] derivatives by the parameters; NULL: not wanted */
    size_t n;
    const sdm_param *params; /* [n_params], of the caller; they name the columns of the slopes */
    size_t n_params;
} cli_points_table;

/* Checks --columns, the outputs and other options of `exact --points`, and fills the columns.
 * SDM_E_ARG. */
sdm_status cli_points_check(const cli_args *args, cli_points_table *t, sdm_error *err);

/* The same for `generate --points`, whose columns are distance, gradient and slopes. */
sdm_status cli_points_check_model(const cli_args *args, cli_points_table *t, sdm_error *err);

/* Allocates the arrays for n points; params[n_params] must outlive the table.
 * cli_points_dispose() frees the arrays. SDM_E_NOMEM. */
sdm_status cli_points_allocate(cli_points_table *t, const sdm_param *params, size_t n_params,
                               size_t n, sdm_error *err);
void cli_points_dispose(cli_points_table *t);

/* Writes the table to all outputs: .csv with a header line and the points x[n][3] in the first
 * columns, .npy as float64 [n][columns]. The answer at a point that has none is empty (.csv) or
 * NaN. Writes the slopes to the file of --jacobian, too. */
sdm_status cli_points_write(const cli_points_table *t, const double *x, const cli_args *args,
                            sdm_error *err);
