/* Text files line by line and word by word, in place, with line numbers for messages. Readers of
   meshes and, from a library of their own, of images use it. */
#ifndef SDM_IO_SCAN_H
#define SDM_IO_SCAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/export.h"
#include "sdm/internal/shared.h"
#include "sdm/status.h"

/* A text file in memory, cut up in place; `at` must be followed by one writable zero byte at `end`.
 */
typedef struct sdm_scan {
    char *at, *end;
    const char *path;
    size_t line;    /* of what was returned last, from 1 */
    size_t lines;   /* read so far */
    char comment;   /* starts a comment that reaches to the end of the line; 0: none */
    bool continues; /* a backslash at the end of a line joins it with the next */
} sdm_scan;

/* Bytes of the byte order mark that UTF-8 text may begin with; the first line is read without it.
 */
size_t sdm_scan_mark(const char *text, size_t size);

/* Next line with something on it, NULL at the end of the text. */
char *sdm_scan_line(sdm_scan *s);

/* Cuts the next word off *line, NULL when there is none. */
SDM_INTERNAL_API char *sdm_scan_word(char **line);

/* Next word of the text, wherever its line ends; NULL at the end of the text. */
char *sdm_scan_token(sdm_scan *s, char **line);

/* The next n words of a line as finite numbers. SDM_E_FORMAT names file, line and word. */
SDM_INTERNAL_API sdm_status sdm_scan_reals(const sdm_scan *s, char **line, double *out, int n,
                                           sdm_error *err);

/* The next word of a line as an integer in [0, limit). `what` names it in the message. */
SDM_INTERNAL_API sdm_status sdm_scan_count(const sdm_scan *s, char **line, int64_t limit,
                                           const char *what, int64_t *out, sdm_error *err);

#endif
