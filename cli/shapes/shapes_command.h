/* The subcommands of `sdmgen shapes`. Each begins with a word before the NAME of a shape; a shape
 * may have the same name as a subcommand, because the word alone is a NAME. */
#pragma once

#include "args/options.h"

/* `sdmgen shapes new NAME`: writes the folder of --out (default NAME) with a plug-in that builds
 * and passes its tests: examples/pebble with NAME in place of its name. SDM_E_ARG: NAME is no name,
 * or there is a shape of that name; SDM_E_IO: the folder exists or cannot be written. After an
 * error nothing is left. */
sdm_status cli_shapes_new(const cli_args *args, sdm_error *err);

/* `sdmgen shapes check [NAME|CONFIG]`: surveys the shape NAME, the shape of a configuration, or the
 * only shape of --plugin; prints the findings and a verdict, and draws nine samples for -o.
 * SDM_E_QUALITY, SDM_E_MESH: the verdict (sdm_shape_survey_verdict()). */
sdm_status cli_shapes_check(const cli_args *args, sdm_error *err);
