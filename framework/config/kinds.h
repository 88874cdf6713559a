/* Keys and defaults that depend on network.kind. */
#pragma once

#include "fields.h"

#define SDM_KIND_CHOICES "pod|sdmnn|deepsdf|imnet|template|auto"

/* True if networks of `kind` (sdm_network_kind) have the key of the row f. */
bool sdm_kind_has(const sdm_field *f, int kind);

/* buf = the kinds of network that have the key, e.g. "pod, sdmnn"; sdm_kind_defaults() adds the
 * default of each kind, e.g. "pod 3, sdmnn 4". Return buf. */
const char *sdm_kind_names(const sdm_field *f, char *buf, size_t size);
const char *sdm_kind_defaults(const sdm_field *f, char *buf, size_t size);

/* Call after the file and all overrides are read. Keys that are not given get the default of the
 * kind of network. A key that this kind does not have is a mistake; but if an override has changed
 * the kind, keys of the file that no longer fit are ignored. `place`: position at which mistakes in
 * keys that are not given are reported. */
void sdm_kinds_settle(sdm_reader *r, sdm_mark place);
