/* The file of --returnparameterfile: one line "name = value" for each result, as 3D Slicer reads
 * them. */
#pragma once

#include "args/options.h"
#include "sdm/shape.h"

/* The lines that were added so far. Zero-initialise it; cli_results_dispose() frees it. A line feed
 * within a value becomes a space, because a line ends a value. */
typedef struct cli_results {
    sdm_text text;
} cli_results;

void cli_results_text(cli_results *r, const char *name, const char *value);
void cli_results_real(cli_results *r, const char *name, double value); /* NaN: an empty value */
void cli_results_reals(cli_results *r, const char *name, const double *v, size_t n);

/* The value "a=4.2 alpha=0.6" */
void cli_results_params(cli_results *r, const char *name, const sdm_param *params, size_t n,
                        const double *values);

/* Writes the file `path` and frees *r. NULL: writes nothing. SDM_E_NOMEM, SDM_E_IO. */
sdm_status cli_results_write(cli_results *r, const char *path, sdm_error *err);
void cli_results_dispose(cli_results *r);
