/* Collects the mistakes in a configuration and prints them, one per line, sorted by position. */
#include "sdm/internal/mistakes.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

/* Strict order of positions, the file before the overrides. All positions in one override count as
 * equal. Mistakes at equal positions stay in the order in which they were found. */
static bool is_before(sdm_mark a, sdm_mark b)
{
    if (a.override != b.override) return a.override < b.override;
    if (a.override > 0) return false;
    return a.line != b.line ? a.line < b.line : a.column < b.column;
}

void sdm_mistakes_add(sdm_mistakes *m, sdm_mark mark, const char *fmt, ...)
{
    size_t kept = m->count < SDM_MISTAKES_SHOWN ? m->count : SDM_MISTAKES_SHOWN;
    size_t at = kept;
    m->count++;
    while (at > 0 && is_before(mark, m->first[at - 1].mark)) at--;
    if (at == SDM_MISTAKES_SHOWN) return;

    // insert; a full list loses its last entry
    size_t moved = (kept < SDM_MISTAKES_SHOWN ? kept : SDM_MISTAKES_SHOWN - 1) - at;
    memmove(&m->first[at + 1], &m->first[at], moved * sizeof m->first[0]);
    m->first[at].mark = mark;
    va_list args;
    va_start(args, fmt);
    vsnprintf(m->first[at].text, sizeof m->first[at].text, fmt, args);
    va_end(args);
}

void sdm_mistakes_starve(sdm_mistakes *m)
{
    m->starved = true;
    m->count++;
}

const char *sdm_mark_print(sdm_mark mark, const char *file, char *buf, size_t size)
{
    char quoted[SDM_QUOTE_MAX];
    if (mark.line > 0)
        snprintf(buf, size, "%s:%d:%d", mark.source ? mark.source : file, mark.line, mark.column);
    else if (mark.source)
        snprintf(buf, size, "argument '%s'", sdm_quote(mark.source, quoted));
    else
        snprintf(buf, size, "%s", file);
    return buf;
}

sdm_status sdm_mistakes_report(const sdm_mistakes *m, sdm_error *err)
{
    enum { TAIL = 32 }; // room for "... and N more"
    char text[SDM_ERROR_TEXT_MAX];
    size_t used = 0, shown = 0;
    if (m->count == 0) return SDM_OK;
    if (m->starved) return sdm_fail(err, SDM_E_NOMEM, "%s: out of memory", m->file);

    // print as many whole lines as fit
    text[0] = 0;
    for (; shown < m->count && shown < SDM_MISTAKES_SHOWN; shown++) {
        char place[SDM_PATH_TEXT_MAX + SDM_QUOTE_MAX], line[sizeof place + SDM_MISTAKE_TEXT_MAX];
        const sdm_mistake *one = &m->first[shown];
        int n = snprintf(line, sizeof line, "%s: %s",
                         sdm_mark_print(one->mark, m->file, place, sizeof place), one->text);
        size_t length = n < 0 ? 0 : (size_t)n < sizeof line ? (size_t)n : sizeof line - 1;
        if (used + length + 1 + TAIL >= sizeof text) break;
        if (used) text[used++] = '\n';
        memcpy(text + used, line, length);
        used += length;
        text[used] = 0;
    }
    if (shown < m->count)
        snprintf(text + used, sizeof text - used, "\n... and %zu more", m->count - shown);
    return sdm_fail(err, SDM_E_CONFIG, "%s", text);
}

const char *sdm_quote(const char *text, char buf[SDM_QUOTE_MAX])
{
    enum { SHOWN = 60 };
    size_t length = strlen(text), n = length;
    if (n > SHOWN) {
        // do not cut a UTF-8 sequence
        n = SHOWN;
        while (n > 0 && ((unsigned char)text[n] & 0xC0) == 0x80) n--;
    }
    for (size_t i = 0; i < n; i++) {
        unsigned char c = (unsigned char)text[i];
        buf[i] = c < 0x20 || c == 0x7F ? '?' : (char)c;
    }
    strcpy(buf + n, n < length ? "..." : "");
    return buf;
}
