/* Texts of files before they are shown: they need not be UTF-8, and may hold bytes that command a
 * terminal. */
#pragma once

#include "sdm/internal/text.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Number of bytes of the UTF-8 character at s (RFC 3629), 1 to 4; 0: the bytes there are none. s
 * ends with a zero byte, which counts as a character. [any thread] */
size_t sdm_utf8_length(const char *s);

/* Appends s with everything that a terminal might obey as \xNN: control characters but tab and line
 * end, marks that change the direction of writing, bytes that are not UTF-8. */
void sdm_text_add_shown(sdm_text *t, const char *s);

#ifdef __cplusplus
}
#endif
