/* Inside of the configuration: a training configuration whose overrides come from places of another file. */
#ifndef SDM_CONFIG_PARSE_H
#define SDM_CONFIG_PARSE_H

#include "sdm/config.h"

/* sdm_config_parse(); a mistake in override i is reported at places[i], e.g. "paper.yaml:14:7", where that is not NULL. places may
   be NULL. */
sdm_status sdm_config_parse_placed(const char *name, const char *text, size_t size, const char *const *overrides,
                                   const char *const *places, size_t n_overrides, sdm_config *out, sdm_error *err);

#endif
