/* The subcommands of `sdmgen shapes`. Each begins with a word before the NAME of a shape; a shape
 * may have the same name as a subcommand, because the word alone is a NAME. */
#pragma once

#include "args/options.h"
#include "sdm/registry.h"

/* `sdmgen shapes new NAME`: writes the folder of --out (default NAME) with a plug-in that builds
 * and passes its tests: examples/pebble with NAME in place of its name. SDM_E_ARG: NAME is no name,
 * or there is a shape of that name; SDM_E_IO: the folder exists or cannot be written. After an
 * error nothing is left. */
sdm_status cli_shapes_new(const cli_args *args, sdm_error *err);

/* `sdmgen shapes check [NAME|CONFIG]`: surveys the shape NAME, the shape of a configuration, or the
 * only shape of --plugin; prints the findings and a verdict, and draws nine samples for -o.
 * SDM_E_QUALITY, SDM_E_MESH: the verdict (sdm_shape_survey_verdict()). */
sdm_status cli_shapes_check(const cli_args *args, sdm_error *err);

/* `sdmgen shapes test [NAME|PLUGIN]`: tests whether the shape NAME, or the only shape of a plug-in,
 * keeps the contract of sdm/shape.h; prints one line for each test and a verdict. Plug-ins are
 * isolated. SDM_E_QUALITY, SDM_E_MESH: the verdict (sdm_conformance_verdict()). */
sdm_status cli_shapes_test(const cli_args *args, sdm_error *err);

/* *name = the only shape of the files of --plugin. usage: the subcommand with its arguments, for
 * the message. SDM_E_ARG. */
sdm_status cli_only_shape(const cli_args *args, const sdm_registry *registry, const char *usage,
                          const char **name, sdm_error *err);
