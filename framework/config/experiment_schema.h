/* The tables of an experiment's configuration and the rules that span several of its keys. */
#ifndef SDM_EXPERIMENT_SCHEMA_H
#define SDM_EXPERIMENT_SCHEMA_H

#include "fields.h"
#include "sdm/internal/experiment.h"

const sdm_section *sdm_experiment_sections(size_t *n);

/* Whether a dotted key, "grid.size", is one of the training configuration. */
bool sdm_experiment_is_training_key(const char *key, size_t length);

/* After the file and the overrides: the rows, and what is missing or said twice. SDM_E_NOMEM. */
sdm_status sdm_experiment_finish(sdm_experiment *e, sdm_reader *r, sdm_error *err);

#endif
