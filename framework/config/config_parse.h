/* What the configurations of a training and of an experiment share. */
#ifndef SDM_CONFIG_PARSE_H
#define SDM_CONFIG_PARSE_H

#include "fields.h"

/* sdm_config_parse(); override i was said in line and column of the file places[i].source, where it
 * has a line. places may be NULL. */
sdm_status sdm_config_parse_placed(const char *name, const char *text, size_t size,
                                   const char *const *overrides, const sdm_mark *places,
                                   size_t n_overrides, sdm_config *out, sdm_error *err);

/* Reads one "key=value" into what the reader is of. Mistakes are recorded; another status only when
 * nothing can go on. */
sdm_status sdm_config_override(sdm_reader *r, const char *text, sdm_mark mark, sdm_error *err);

/* The name of a file without folders and ending, of at most 200 bytes, or `none` where nothing is
   left. Bytes that a text must not hold become '_'. */
void sdm_bare_name(const char *file, const char *none, char out[256]);

#endif
