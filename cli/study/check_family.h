/* sdmgen shapes check: surveys a family of shapes. */
#pragma once

#include "args/options.h"

/* Surveys the shape files.items[1] of the command line, the shape of the configuration of that
 * name, or the only shape of --plugin; prints the findings and a verdict, and draws nine samples
 * for -o. SDM_E_QUALITY, SDM_E_MESH: the verdict (sdm_shape_survey_verdict()). */
sdm_status cli_check_family(const cli_args *args, sdm_error *err);
