/* What depends on network.kind: which keys there are, and their defaults. */
#ifndef SDM_KINDS_H
#define SDM_KINDS_H

#include "fields.h"

#define SDM_KIND_CHOICES "pod|sdmnn|deepsdf|imnet"

/* True when networks of that kind have the key. */
bool sdm_kind_has(const sdm_field *f, int kind);

/* Names of the kinds that have the key, or their defaults: "pod 3, sdmnn 4". */
const char *sdm_kind_names(const sdm_field *f, char *buf, size_t size);
const char *sdm_kind_defaults(const sdm_field *f, char *buf, size_t size);

/* After the file and the overrides. A key that the kind does not have is a mistake; only those in
   the file step back when an override has changed the kind. What is not given takes the default of
   the kind. `place` is for mistakes that have no better one. */
void sdm_kinds_settle(sdm_reader *r, sdm_mark place);

#endif
