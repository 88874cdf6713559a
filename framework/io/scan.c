/* Splits the text of a file into lines and words, in place, and counts lines for messages. */
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

/* Cuts the next line off the text, together with its continuation lines; false at the end of the
 * text. */
static bool cut_line(sdm_scan *scan, char **line)
{
    if (scan->lines == 0) scan->at += sdm_scan_mark(scan->at, (size_t)(scan->end - scan->at));
    if (scan->at >= scan->end) return false;
    scan->line = ++scan->lines;
    *line = scan->at;
    for (;;) {
        char *stop = memchr(scan->at, '\n', (size_t)(scan->end - scan->at));
        scan->at = stop ? stop + 1 : scan->end;
        if (!stop) return true;
        // the last character of the line, before an optional carriage return
        char *last = stop > *line && stop[-1] == '\r' ? stop - 2 : stop - 1;
        *stop = '\0';
        if (!scan->continues || last < *line || *last != '\\') return true;
        memset(last, ' ', (size_t)(stop + 1 - last));
        scan->lines++;
    }
}

char *sdm_scan_line(sdm_scan *scan)
{
    char *line;
    while (cut_line(scan, &line)) {
        char *comment = scan->comment ? strchr(line, scan->comment) : NULL;
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

char *sdm_scan_token(sdm_scan *scan, char **line)
{
    for (;;) {
        char *word = *line ? sdm_scan_word(line) : NULL;
        if (word) return word;
        *line = sdm_scan_line(scan);
        if (!*line) return NULL;
    }
}

sdm_status sdm_scan_reals(const sdm_scan *scan, char **line, double *out, int n, sdm_error *err)
{
    for (int i = 0; i < n; i++) {
        const char *word = sdm_scan_word(line);
        if (!word)
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %d number%s on the line, need %d",
                            scan->path, scan->line, i, i == 1 ? "" : "s", n);
        if (!sdm_parse_real(word, &out[i]))
            return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is not a finite number", scan->path,
                            scan->line, word);
    }
    return SDM_OK;
}

sdm_status sdm_scan_count(const sdm_scan *scan, char **line, int64_t limit, const char *what,
                          int64_t *out, sdm_error *err)
{
    const char *word = sdm_scan_word(line);
    if (!word)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: the %s is missing", scan->path, scan->line,
                        what);
    if (!sdm_parse_int(word, out))
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: '%.40s' is not a whole number (%s)", scan->path,
                        scan->line, word, what);
    if (*out < 0 || *out >= limit)
        return sdm_fail(err, SDM_E_FORMAT, "%s:%zu: %s %lld is outside 0 .. %lld", scan->path,
                        scan->line, what, (long long)*out, (long long)limit - 1);
    return SDM_OK;
}
