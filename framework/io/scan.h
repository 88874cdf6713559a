/* Splits the text of a file into lines and words, in place, and counts lines for messages. Used by
   the mesh readers, and by the image readers in libsdmgen_image: hence the exported functions. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/export.h"
#include "sdm/internal/shared.h"
#include "sdm/status.h"

/* A text in memory, which is modified: words and lines are ended by zero bytes. Before the first
   call set at, end and path, and comment and continues as the format needs; all other members are
   0. */
typedef struct sdm_scan {
    /* the text that has not been read; *end must be a writable zero byte */
    char *at, *end;
    /* name of the file, for messages */
    const char *path;
    /* number of the line that was returned last, from 1 */
    size_t line;
    /* number of lines read */
    size_t lines;
    /* this character starts a comment up to the end of the line; 0: no comments */
    char comment;
    /* true: a backslash at the end of a line joins it with the next line */
    bool continues;
} sdm_scan;

/* Length of the UTF-8 byte order mark at the start of the text: 3, or 0 without one.
 * sdm_scan_line() skips it. */
size_t sdm_scan_mark(const char *text, size_t size);

/* The next line that has more than blanks and comments, without leading blanks; NULL at the end of
 * the text. */
char *sdm_scan_line(sdm_scan *scan);

/* The next word of *line, which is moved behind it; NULL when the line has no further word. */
SDM_INTERNAL_API char *sdm_scan_word(char **line);

/* The next word of *line or, after its end, of the following lines; NULL at the end of the text.
 * *line is NULL before the first call. */
char *sdm_scan_token(sdm_scan *scan, char **line);

/* Reads the next n words of *line as finite numbers into out[n]. SDM_E_FORMAT names file, line and
 * word. */
SDM_INTERNAL_API sdm_status sdm_scan_reals(const sdm_scan *scan, char **line, double *out, int n,
                                           sdm_error *err);

/* Reads the next word of *line as an integer in 0 .. limit - 1. `what` is its name in messages.
 * SDM_E_FORMAT. */
SDM_INTERNAL_API sdm_status sdm_scan_count(const sdm_scan *scan, char **line, int64_t limit,
                                           const char *what, int64_t *out, sdm_error *err);
