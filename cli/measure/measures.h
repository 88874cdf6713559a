/* The measures of a shape on the command line: --measure and --depth. */
#pragma once

#include "args/options.h"
#include "sdm/registry.h"

/* Largest number of depths of --depth. */
#define CLI_DEPTHS_MAX 64

typedef struct cli_depths {
    double mm[CLI_DEPTHS_MAX];
    size_t n;
} cli_depths;

/* Reads --depth and checks it against the shape, before any work. SDM_E_ARG: --depth without
 * --measure, no list of numbers, or a shape without measures of a depth. shape: NULL without
 * --measure. */
sdm_status cli_read_depths(const cli_args *args, const sdm_instance *shape, cli_depths *out,
                           sdm_error *err);

/* Prints the measures, one a line. with_sd: also standard deviations, of a fit. */
void cli_print_measures(const sdm_measures *m, bool with_sd);

/* Adds the array "measures" to the open object. with_sd: also standard deviations, of a fit. */
void cli_json_measures(const sdm_measures *m, bool with_sd, sdm_json *json);
