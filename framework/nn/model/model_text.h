/* The description of a model: lines "key=value" that are written and read in the same fixed
   order. */
#pragma once

#include <stdbool.h>

#include "sdm/internal/text.h"

/* Append the line "key=v" with one number, or with n numbers separated by spaces. The decimals read
   back to exactly the same values. */
void sdm_text_add_real(sdm_text *t, const char *key, double v);
void sdm_text_add_reals(sdm_text *t, const char *key, const double *v, size_t n);

/* Reader of the lines. The first failure (another key, or an invalid value) makes all later reads
   fail too, so that a series of reads needs only one sdm_lines_check(). Set at and end before the
   first read, all else to zero. */
typedef struct sdm_lines {
    const char *at, *end; /* rest of the text */
    char value[1100];     /* value of the last line read */
    bool failed;
    char key[64]; /* key of the last line read, or of the line that failed */
} sdm_lines;

/* Whether the next line exists and has this key; reads nothing. */
bool sdm_lines_next_is(const sdm_lines *r, const char *key);

/* The value of the next line, whose key must be `key`; valid until the next read. "" on failure. */
const char *sdm_lines_value(sdm_lines *r, const char *key);

/* Read the value of the next line in the same way and parse it as n numbers out[n], a number, an
   integer in min .. max, or a text of less than `size` bytes, NUL-terminated. On failure the
   integer is min, the text is "", the single number is 0, and out[] may be unchanged. */
void sdm_lines_reals(sdm_lines *r, const char *key, double *out, size_t n);
double sdm_lines_real(sdm_lines *r, const char *key);
int64_t sdm_lines_int(sdm_lines *r, const char *key, int64_t min, int64_t max);
void sdm_lines_text(sdm_lines *r, const char *key, char *out, size_t size);

/* Returns SDM_E_FORMAT, with the key in the message, if a read has failed. */
sdm_status sdm_lines_check(const sdm_lines *r, sdm_error *err);
