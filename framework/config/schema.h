/* The tables of the experiment configuration and the rules that span several keys. */
#ifndef SDM_SCHEMA_H
#define SDM_SCHEMA_H

#include "fields.h"

const sdm_section *sdm_config_sections(size_t *n);

/* After each override: the keys it excludes step back (another budget, grid.origin or grid.centre).
 */
void sdm_config_settle_override(sdm_reader *r, int override);

/* After the file and the overrides: what is missing, what excludes another, and values made of
   several keys. `top` is the place for what has no better one. */
void sdm_config_finish(sdm_reader *r, sdm_mark top);

#endif
