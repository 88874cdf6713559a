/* The field tables (fields.h) of a training configuration, and the rules that involve several
 * keys. */
#pragma once

#include "fields.h"

/* The field tables of all sections, constant; *n = number of sections. */
const sdm_section *sdm_config_sections(size_t *n);

/* Call after each override with the number of the override: resets earlier keys that this override
 * replaces. A budget of `train` replaces the other budgets; grid.centre and grid.origin replace
 * each other. */
void sdm_config_settle_override(sdm_reader *r, int override);

/* Call after the file and all overrides: records missing keys and keys that exclude each other, and
 * computes values that depend on several keys. `top`: position for mistakes without a better one.
 */
void sdm_config_finish(sdm_reader *r, sdm_mark top);
