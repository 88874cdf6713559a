/* A configuration read with the words of the command line, and the shape it names. */
#ifndef CLI_CONFIG_SHAPE_H
#define CLI_CONFIG_SHAPE_H

#include "args/options.h"
#include "sdm/internal/config.h"
#include "sdm/registry.h"

/* Reads files.items[0] with the key=value words behind it, then --seed, --threads. A configuration
   is over 100 kB: *out is freed with sdm_free(). SDM_E_CONFIG with one line for each mistake. */
sdm_status cli_read_config(const cli_args *args, sdm_config **out, sdm_error *err);

/* The configured shape with its options; mistakes are given their place in the file. Paths of data
 * files in c become absolute. */
sdm_status cli_config_shape(sdm_config *c, const sdm_registry *r, sdm_instance **out,
                            sdm_error *err);

#endif
