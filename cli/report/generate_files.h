/* Names of the files that `sdmgen generate` writes for each row of parameters: the outputs,
 * --gradient and --jacobian. */
#pragma once

#include "args/options.h"

/* Zero-initialise; cli_row_files_dispose() frees, also after an error. */
typedef struct cli_row_files {
    cli_list list; /* outputs in their order, then --gradient and --jacobian if given */
    const char *gradient, *jacobian; /* NULL: not wanted */
    char *text;                      /* storage of numbered names */
} cli_row_files;

/* *out = the names of the files of row `row` (counted from 1). With --params the names contain the
 * number of the row. SDM_E_ARG: a name is too long. */
sdm_status cli_row_files_name(const cli_args *args, size_t row, cli_row_files *out, sdm_error *err);
void cli_row_files_dispose(cli_row_files *f);

/* Before any work: checks the types of the files, and that the files of row `last` can be written.
 * SDM_E_ARG, SDM_E_IO. */
sdm_status cli_row_files_check(const cli_args *args, size_t last, sdm_error *err);
