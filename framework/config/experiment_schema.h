/* The field tables (fields.h) of an experiment's configuration, and the rules that involve several
 * of its keys. */
#pragma once

#include "fields.h"
#include "sdm/internal/experiment.h"

/* The field tables of the sections of the file, constant; *n = number of sections. */
const sdm_section *sdm_experiment_sections(size_t *n);

/* True if the dotted key[length], e.g. "grid.size", belongs to the training configuration. */
bool sdm_experiment_is_training_key(const char *key, size_t length);

/* Call after the file and all overrides: makes the rows, and records missing keys, names that occur
 * twice and references to rows or methods that do not exist. SDM_E_NOMEM. */
sdm_status sdm_experiment_finish(sdm_experiment *e, sdm_reader *r, sdm_error *err);
