/* Growing text buffer, JSON writer, conversion of numbers independent of the locale, and search for
 * a similar name ("did you mean"). */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/internal/shared.h"
#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Text buffer. Zero-initialise it; sdm_text_dispose() frees it. `data` is NUL-terminated (NULL
 * before the first text is added). sdm_text_add() appends a formatted text. If it fails, it sets
 * `failed`, and later calls do nothing, so one check at the end suffices. */
typedef struct sdm_text {
    char *data;
    size_t size, capacity;
    bool failed;
} sdm_text;

SDM_INTERNAL_API void sdm_text_dispose(sdm_text *t);
SDM_INTERNAL_API void sdm_text_add(sdm_text *t, const char *fmt, ...) SDM_PRINTF(2, 3);

/* JSON writer. Zero-initialise it; sdm_json_dispose() frees it. It inserts commas and quotes
 * strings. `key` is NULL inside an array. Numbers have the fewest digits that read back to the same
 * value; NaN and infinities become null. Errors set text.failed. */
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

/* Parse the whole string s as a finite decimal number with '.' as decimal point, or as an integer.
 * Return false for anything else, including NaN, infinities and overflow. */
SDM_INTERNAL_API bool sdm_parse_real(const char *s, double *out);
SDM_INTERNAL_API bool sdm_parse_int(const char *s, int64_t *out);

/* The end of a message about a text that is not a number: "; a decimal number has a point: 0.5" for
 * "0,5", "" for a text that is no number with a decimal comma. Returns buf. */
SDM_INTERNAL_API const char *sdm_comma_hint(const char *s, char buf[64]);

/* Writes v with the fewest digits that read back to the same value, with '.' as decimal point.
 * Returns buf. */
SDM_INTERNAL_API const char *sdm_format_real(double v, char buf[32]);

/* "; was it given in metres? It needs mm" for a length outside its range that would be in it or
 * near it if it were in metres, the same for micrometres, and for an angle in rad that would be in
 * its range if it were in degrees; "" for others. */
const char *sdm_unit_question(double value, double min, double max, const char *unit);

/* SDM_E_RANGE, "parameter 'a' = 9 mm, allowed 2 .. 5 mm" and sdm_unit_question(), with the value in
 * the right unit as ": a=9": the one text about a parameter out of its range min .. max. */
sdm_status sdm_fail_range(const char *name, double value, double min, double max, const char *unit,
                          sdm_error *err);

/* buf[size] = "a, b, c", the names for a message; names that do not fit become "...". Returns buf.
 */
const char *sdm_list_names(const char *const *names, size_t n, char *buf, size_t size);

/* True for the name of a shape, a parameter or an option: SDM_NAME_RULE says which texts are. NULL
 * is none. */
bool sdm_is_name(const char *text);
#define SDM_NAME_LENGTH_MAX 63
#define SDM_NAME_RULE                                                                              \
    "names are a small letter, then small letters, digits and _, at most 63 in all"

/* The most similar of names[n] to `word` by optimal string alignment distance, which is at most 1,
 * or about a third of the characters of `word` if both begin with the same one; if none is similar,
 * the first that begins with `word`, if it has three characters or more; else, if it has five, the
 * first that begins with all but its last one; else NULL. */
const char *sdm_nearest_name(const char *word, const char *const *names, size_t n);

#ifdef __cplusplus
}
#endif
