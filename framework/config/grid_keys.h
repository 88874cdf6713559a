/* The rules of the section `grid`: which keys may stand together, and what follows from them. */
#pragma once

#include "fields.h"

/* `grid: auto`, the word in place of the keys: forgets the keys that were given before. */
void sdm_config_grid_auto(sdm_reader *r, sdm_mark mark);

/* Call after an override is read: a key that it gives replaces those of before that exclude it. */
void sdm_config_settle_grid(sdm_reader *r, int override);

/* Call after the file and all overrides are read: checks the keys, and completes the grid unless
 * it is to be fitted to the shapes. `section`: position of mistakes of the whole section. */
void sdm_config_finish_grid(sdm_reader *r, sdm_mark section);
