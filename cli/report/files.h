/* Names of files on the command line. */
#ifndef CLI_FILES_H
#define CLI_FILES_H

#include "args/options.h"

/* Whether the name has this ending, in capitals or not, and more before it. */
bool cli_ends_with(const char *path, const char *suffix);

/* Before any work: every output can be made, and none is, under whatever name, an input or another
   output. outputs NULL: all that the command line names. SDM_E_ARG, SDM_E_IO. */
sdm_status cli_check_files(const cli_args *args, const cli_list *outputs, sdm_error *err);

#endif
