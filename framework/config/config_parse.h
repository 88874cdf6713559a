/* Functions shared by training configurations and experiments. */
#pragma once

#include "fields.h"

/* As sdm_config_parse(), but with the origin of each override: if places[i].line > 0, mistakes in
 * overrides[i] are reported at that line and column of the file places[i].source, else as mistakes
 * in an argument. `places` may be NULL. */
sdm_status sdm_config_parse_placed(const char *name, const char *text, size_t size,
                                   const char *const *overrides, const sdm_mark *places,
                                   size_t n_overrides, sdm_config *out, sdm_error *err);

/* Reads one "key=value" into the struct r->target. Mistakes are recorded, and the result is still
 * SDM_OK. After any other status (SDM_E_NOMEM) the caller must stop reading. */
sdm_status sdm_config_override(sdm_reader *r, const char *text, sdm_mark mark, sdm_error *err);

/* out = the name of `file` without folders and extension, at most 200 bytes; `none` if this name is
 * empty. Bytes that are not printable UTF-8 become '_'. */
void sdm_bare_name(const char *file, const char *none, char out[256]);

/* Appends a table of every key of sections[n]: name, type, range, default, unit, meaning. */
void sdm_fields_describe(const sdm_section *sections, size_t n, bool markdown, sdm_text *out);
