/* Reads the configuration of a training with overrides from the command line, and creates
 * its shape. */
#pragma once

#include "args/options.h"
#include "sdm/internal/config.h"
#include "sdm/registry.h"

/* Reads the file files.items[0]; the key=value arguments after it, --seed and --threads override
 * its keys. *out (over 100 kB, so on the heap) is freed with sdm_free(). SDM_E_ARG: an argument is
 * not key=value; SDM_E_IO; SDM_E_CONFIG with one line for each mistake. */
sdm_status cli_read_config(const cli_args *args, sdm_config **out, sdm_error *err);

/* Creates the configured shape with its options; *out is freed with sdm_instance_free(). Relative
 * paths start from the folder of the configuration; in c they become absolute, so that a copy of
 * the configuration elsewhere names the same files. A grid that is to be fitted to the shapes
 * (grid: auto) is completed, and a notice tells its numbers. SDM_E_CONFIG with the place in the
 * file. */
sdm_status cli_config_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                            sdm_error *err);
