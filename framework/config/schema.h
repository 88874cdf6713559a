/* The tables of a training configuration, and the rules that involve several keys. */
#ifndef SDM_SCHEMA_H
#define SDM_SCHEMA_H

#include "fields.h"

/* The tables, constant; *n = their number. */
const sdm_section *sdm_config_sections(size_t *n);

/* Call after each override, by its number: resets earlier keys that it replaces (the other budgets
 * of train, or grid.origin by grid.centre and the reverse). */
void sdm_config_settle_override(sdm_reader *r, int override);

/* Call after the file and all overrides: records missing keys and keys that exclude each other, and
 * computes values that depend on several keys. `top`: position for mistakes without a better one.
 */
void sdm_config_finish(sdm_reader *r, sdm_mark top);

#endif
