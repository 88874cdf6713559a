/* Texts of a JSON document that was read. */
#pragma once

#include <stdbool.h>

#include "sdm/internal/json_read.h"

/* buf[size] = the string at index i with its escapes replaced; characters beyond ASCII that are
 * escaped become '?'. false: it is no string, or too long. */
bool cli_json_word(const sdm_json_document *d, size_t i, char *buf, size_t size);
