/* Reads JSON (RFC 8259) from memory into a flat list of values. */
#pragma once

#include <stdbool.h>
#include <stddef.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A value: `kind` is '{', '[', '"', '0' (a number) or 't', 'f', 'n' (true, false, null). `at` and
 * `size` are its text, of a string without the quotes and with its escapes as they are. The values
 * inside it follow; those of an object are key, value, key, value. `next` is the index behind the
 * last of them. */
typedef struct sdm_json_value {
    const char *at;
    size_t size, next;
    char kind;
} sdm_json_value;

/* values[0] is the whole document. Zero-initialise; sdm_json_document_dispose() frees. */
typedef struct sdm_json_document {
    sdm_json_value *values;
    size_t n, capacity;
} sdm_json_document;

/* Parses text[size], followed by a zero byte, which must stay while the document is used. Values
 * nest at most 64 deep; memory is at most 64 bytes for each byte of text. `name` is for messages.
 * SDM_E_FORMAT with the line, SDM_E_NOMEM. [any thread] */
sdm_status sdm_json_parse(const char *name, const char *text, size_t size, sdm_json_document *out,
                          sdm_error *err);
void sdm_json_document_dispose(sdm_json_document *d);

/* Index of the member `key` of the object at index i; 0: there is none, or i is no object. */
size_t sdm_json_member(const sdm_json_document *d, size_t i, const char *key);

/* True when the value is a string with this text. */
bool sdm_json_is(const sdm_json_document *d, size_t i, const char *text);

/* buf[size] = the string at index i with its escapes replaced; characters beyond ASCII that are
 * escaped become '?'. false: it is no string, or too long. */
bool sdm_json_word(const sdm_json_document *d, size_t i, char *buf, size_t size);

/* The value as a finite number; false when it is none. */
bool sdm_json_number(const sdm_json_document *d, size_t i, double *out);

#ifdef __cplusplus
}
#endif
