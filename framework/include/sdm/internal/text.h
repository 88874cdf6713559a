/* A growing text buffer, JSON on top of it, number parsing without the locale, and "did you mean".
 */
#ifndef SDM_TEXT_H
#define SDM_TEXT_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/shared.h"
#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Zero-initialise; sdm_text_dispose() frees. `data` is NUL-terminated (NULL while empty). A failed
   append sets `failed` and makes the following ones do nothing, so a chain needs one check. */
typedef struct sdm_text {
    char *data;
    size_t size, capacity;
    bool failed;
} sdm_text;

SDM_INTERNAL_API void sdm_text_dispose(sdm_text *t);
SDM_INTERNAL_API void sdm_text_add(sdm_text *t, const char *fmt, ...) SDM_PRINTF(2, 3);

/* JSON writer: objects and arrays with commas placed by the writer. `key` is NULL inside an array.
   Numbers are written with the fewest digits that read back the same; NaN and infinities become
   null. */
typedef struct sdm_json {
    sdm_text text;
    int depth;
    bool needs_comma[32];
} sdm_json;

void sdm_json_open(sdm_json *j, const char *key, char bracket); /* '{' or '[' */
void sdm_json_close(sdm_json *j, char bracket);                 /* '}' or ']' */
void sdm_json_real(sdm_json *j, const char *key, double v);
void sdm_json_int(sdm_json *j, const char *key, int64_t v);
void sdm_json_uint(sdm_json *j, const char *key, uint64_t v);
void sdm_json_bool(sdm_json *j, const char *key, bool v);
void sdm_json_text(sdm_json *j, const char *key, const char *v);
void sdm_json_dispose(sdm_json *j);

/* Parses the whole of `s` as a finite decimal number; the locale plays no part. False for anything
   else, NaN, infinities and overflow included. */
SDM_INTERNAL_API bool sdm_parse_real(const char *s, double *out);
SDM_INTERNAL_API bool sdm_parse_int(const char *s, int64_t *out);

/* Writes v with the fewest digits that read back the same; buf has 32 bytes; returns buf. */
SDM_INTERNAL_API const char *sdm_format_real(double v, char buf[32]);

/* The name nearest to `word` among names[n] (optimal string alignment distance), or NULL when none
 * is near. */
const char *sdm_nearest_name(const char *word, const char *const *names, size_t n);

#ifdef __cplusplus
}
#endif
#endif
