/* Lists of key=value texts with their positions, made from a YAML tree. */
#pragma once

#include "sdm/internal/experiment.h"
#include "yaml_tree.h"

/* Appends "key=value" for every leaf below the mapping `node`. The key is `prefix` ("" for none)
 * and the names on the path to the leaf, joined by dots: {grid: {spacing: 0.2}} gives
 * "grid.spacing=0.2". Lists are leaves. Returns false after a mistake was recorded. */
bool sdm_overrides_add_tree(sdm_overrides *o, const char *prefix, const sdm_tree_node *node,
                            sdm_mistakes *mistakes);

/* Appends a copy of one "key=value" text. SDM_E_NOMEM. */
sdm_status sdm_overrides_add(sdm_overrides *o, const char *text, sdm_mark mark, sdm_error *err);

void sdm_overrides_dispose(sdm_overrides *o);
