/* Describes a statistical shape model. */
#pragma once

#include "sdm/internal/ssm.h"

/* Prints the sizes, the origin, and how much of the variance each mode has (compactness). */
void cli_print_ssm(const char *path, const sdm_ssm *model);

/* Prints the same as JSON. SDM_E_NOMEM. */
sdm_status cli_json_ssm(const char *path, const sdm_ssm *model, sdm_error *err);
