/* Text files line by line and word by word, in place, with line numbers for messages. */
#include "scan.h"

#include <string.h>

#include "sdm/internal/text.h"

static bool is_blank(char c)
{
    return c == ' ' || c == '\t' || c == '\r' || c == '\f' || c == '\v' || c == '\0';
}

size_t sdm_scan_mark(const char *text, size_t size)
{
    return size >= 3 && !memcmp(text, "\xEF\xBB\xBF", 3) ? 3 : 0;
}

/* Cuts one line off the text; false at its end. */
static bool cut_line(sdm_scan *s, char **line)
{
    if (s->lines == 0) s->at += sdm_scan_mark(s->at, (size_t)(s->end - s->at));
    if (s->at >= s->end) return false;
    s->line = ++s->lines;
    *line = s->at;
    for (;;) {
        char *stop = memchr(s->at, '\n', (size_t)(s->end - s->at));
        s->at = stop ? stop + 1 : s->end;
        if (!stop) return true;
        char *last = stop > *line && stop[-1] == '\r' ? stop - 2 : stop - 1;
        *stop = '\0';
        if (!s->continues || last < *line || *last != '\\') return true;
        memset(last, ' ', (size_t)(stop + 1 - last));
        s->lines++;
    }
}

char *sdm_scan_line(sdm_scan *s)
{
    char *line;
    while (cut_line(s, &line)) {
        char *comment = s->comment ? strchr(line, s->comment) : NULL;
        if (comment) *comment = '\0';
        while (*line != '\0' && is_blank(*line)) line++;
        if (*line != '\0') return line;
    }
    return NULL;
}

char *sdm_scan_word(char **line)
{
    char *p = *line;
    while (*p != '\0' && is_blank(*p)) p++;
    if (*p == '\0') return NULL;
    char *word = p;
    while (!is_blank(*p)) p++;
    *line = *p == '\0' ? p : p + 1;
    *p = '\0';
    return word;
}

char *sdm_scan_token(sdm_scan *s, char **line)
{
    for (;;) {
        char *word = *line ? sdm_scan_word(line) : NULL;
        if (word) return word;
        *line = sdm_scan_line(s);
        if (!*line) return NULL;
    }
}

sdm_status sdm_scan_reals(const sdm_scan *s, char **line, double *out, int n, sdm_error *err)
{
    for (int i = 0; i < n; i++) {
        const char *word = sdm_scan_word(line);
        if (!word)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %d number%s on the line, need %d", s->path,
                            s->line, i, i == 1 ? "" : "s", n);
        if (!sdm_parse_real(word, &out[i]))
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is not a finite number", s->path,
                            s->line, word);
    }
    return SDM_OK;
}

sdm_status sdm_scan_count(const sdm_scan *s, char **line, int64_t limit, const char *what,
                          int64_t *out, sdm_error *err)
{
    const char *word = sdm_scan_word(line);
    if (!word)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the %s is missing", s->path, s->line, what);
    if (!sdm_parse_int(word, out))
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is not a whole number (%s)", s->path,
                        s->line, word, what);
    if (*out < 0 || *out >= limit)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %s %lld is outside 0 .. %lld", s->path, s->line,
                        what, (long long)*out, (long long)limit - 1);
    return SDM_OK;
}
