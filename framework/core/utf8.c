/* Lengths of UTF-8 characters; texts without control characters. */
#include "sdm/internal/utf8.h"

#include <stdint.h>

size_t sdm_utf8_length(const char *s)
{
    const uint8_t *p = (const uint8_t *)s;
    if (p[0] < 0x80) return 1;
    const size_t n = p[0] >= 0xF5 ? 0 : p[0] >= 0xF0 ? 4 : p[0] >= 0xE0 ? 3 : p[0] >= 0xC2 ? 2 : 0;
    for (size_t i = 1; i < n; i++)
        if ((p[i] & 0xC0) != 0x80) return 0;
    // longer than needed, a surrogate, beyond U+10FFFF
    if ((p[0] == 0xE0 && p[1] < 0xA0) || (p[0] == 0xED && p[1] >= 0xA0) ||
        (p[0] == 0xF0 && p[1] < 0x90) || (p[0] == 0xF4 && p[1] >= 0x90))
        return 0;
    return n;
}

/* True if a terminal might obey the character of n bytes at p. */
static bool commands(const uint8_t *p, size_t n)
{
    if (n == 1) return (p[0] < 0x20 && p[0] != '\n' && p[0] != '\t') || p[0] == 0x7F;
    if (n == 2) return p[0] == 0xC2 && p[1] < 0xA0; // U+0080 to U+009F
    // U+202A to U+202E, U+2066 to U+2069
    return n == 3 && p[0] == 0xE2 &&
           ((p[1] == 0x80 && p[2] >= 0xAA && p[2] <= 0xAE) ||
            (p[1] == 0x81 && p[2] >= 0xA6 && p[2] <= 0xA9));
}

void sdm_text_add_shown(sdm_text *t, const char *s)
{
    while (*s && !t->failed) {
        const uint8_t *p = (const uint8_t *)s;
        const size_t n = sdm_utf8_length(s);
        const bool hidden = !n || commands(p, n);
        for (size_t i = 0; i < (n ? n : 1); i++)
            sdm_text_add(t, hidden ? "\\x%02X" : "%c", (unsigned)p[i]);
        s += n ? n : 1;
    }
}
