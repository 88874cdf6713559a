/* Names of the files that generate writes for each row of parameters: the outputs, --gradient,
 * --jacobian. */
#ifndef CLI_GENERATE_FILES_H
#define CLI_GENERATE_FILES_H

#include "args/options.h"

/* Zero-initialise. */
typedef struct cli_row_files {
    cli_list list; /* the outputs in their order, then the others, as far as they are wanted */
    const char *gradient, *jacobian;
    char *text;
} cli_row_files;

/* The files of a row, numbered with --params; to be disposed of, also after an error. SDM_E_ARG: a
 * name is too long. */
sdm_status cli_row_files_name(const cli_args *args, size_t row, cli_row_files *out, sdm_error *err);
void cli_row_files_dispose(cli_row_files *f);

/* Before any work: the types, and that the files of row `last` can be made. SDM_E_ARG, SDM_E_IO. */
sdm_status cli_row_files_check(const cli_args *args, size_t last, sdm_error *err);

#endif
