/* Reads the configuration of a training with overrides from the command line, and creates
 * its shape. */
#pragma once

#include "args/options.h"
#include "sdm/internal/config.h"
#include "sdm/registry.h"

/* Opens the configuration files.items[0] with its overrides: the key=value arguments after it,
 * --seed and --threads; a registry of shapes; and the configured shape. Also after an error the
 * caller frees *config (over 100 kB, so on the heap) with sdm_free(), *shape with
 * sdm_instance_free() and *registry with sdm_registry_free(); the three must be NULL before the
 * call. SDM_E_ARG: an argument is not key=value; SDM_E_IO; SDM_E_CONFIG with one line for each
 * mistake in the keys and in the options, ranges and distributions of the shape; errors of
 * cli_open_registry(). A fitted grid is told as by cli_config_shape(), to the command `config` with
 * the reasons for its numbers. */
sdm_status cli_open_config(const cli_args *args, sdm_config **config, sdm_registry **registry,
                           sdm_instance **shape, sdm_error *err);

/* Refuses a training whose maps do not fit into data.memory_gb (SDM_E_CONFIG). With network.kind
 * auto or template it is a warning: a template needs fewer maps. */
sdm_status cli_check_memory(const sdm_config *c, const sdm_instance *shape, sdm_error *err);

/* Creates the configured shape with its options and checks the ranges and distributions; *out is
 * freed with sdm_instance_free(). Relative paths start from the folder of the configuration; in c
 * they become absolute, so that a copy of the configuration elsewhere names the same files. A grid
 * that is to be fitted to the shapes (grid: auto) is completed, and a notice tells its numbers.
 * SDM_E_CONFIG with a line "file:line:column: ..." for each mistake. */
sdm_status cli_config_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                            sdm_error *err);
