/* Text buffer, conversion of numbers independent of the locale, similar names. */
#include "sdm/internal/text.h"

#include <locale.h>
#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

void sdm_text_dispose(sdm_text *t)
{
    if (!t) return;
    free(t->data);
    *t = (sdm_text){0};
}

void sdm_text_add(sdm_text *t, const char *fmt, ...)
{
    if (t->failed) return;
    va_list args, again;
    va_start(args, fmt);
    va_copy(again, args);
    const int n = vsnprintf(NULL, 0, fmt, args);
    va_end(args);
    if (n < 0) t->failed = true;
    const size_t need = t->size + (n < 0 ? 0 : (size_t)n) + 1;
    if (!t->failed && need > t->capacity) {
        const size_t capacity = need < 256 ? 256 : need * 2;
        char *bigger = realloc(t->data, capacity);
        if (bigger) t->data = bigger, t->capacity = capacity;
        t->failed = !bigger;
    }
    if (!t->failed) {
        vsnprintf(t->data + t->size, t->capacity - t->size, fmt, again);
        t->size += (size_t)n;
    }
    va_end(again);
}

/* strtod() expects the decimal point of the current locale, so '.' is replaced by that character.
 */
bool sdm_parse_real(const char *s, double *out)
{
    char buf[512];
    const size_t n = strlen(s);
    if (n == 0 || n >= sizeof buf || strspn(s, "0123456789+-.eE") != n) return false;
    const char point = localeconv()->decimal_point[0];
    for (size_t i = 0; i <= n; i++) buf[i] = s[i] == '.' ? point : s[i];
    char *end;
    const double v = strtod(buf, &end);
    if (*end || !isfinite(v)) return false;
    *out = v;
    return true;
}

const char *sdm_comma_hint(const char *s, char buf[64])
{
    char point[24];
    double v;
    const char *comma = strchr(s, ',');
    *buf = '\0';
    if (!comma || strchr(comma + 1, ',') || strlen(s) >= sizeof point) return buf;
    snprintf(point, sizeof point, "%s", s);
    point[comma - s] = '.';
    if (comma > s && comma[1] && sdm_parse_real(point, &v))
        snprintf(buf, 64, "; a decimal number has a point: %s", point);
    return buf;
}

bool sdm_parse_int(const char *s, int64_t *out)
{
    const bool negative = *s == '-';
    if (*s == '-' || *s == '+') s++;
    if (!*s) return false;
    uint64_t v = 0;
    const uint64_t limit = negative ? (uint64_t)INT64_MAX + 1 : (uint64_t)INT64_MAX;
    for (; *s; s++) {
        if (*s < '0' || *s > '9') return false;
        const uint64_t digit = (uint64_t)(*s - '0');
        if (v > (limit - digit) / 10) return false;
        v = v * 10 + digit;
    }
    *out = negative ? (v == (uint64_t)INT64_MAX + 1 ? INT64_MIN : -(int64_t)v) : (int64_t)v;
    return true;
}

const char *sdm_format_real(double v, char buf[32])
{
    const char point = localeconv()->decimal_point[0];
    if (fabs(v) < 1e15 && v == floor(v)) { // integers without exponent: 20, not 2e+01
        snprintf(buf, 32, "%.0f", v);
        return buf;
    }
    for (int digits = 1; digits <= 17; digits++) {
        snprintf(buf, 32, "%.*g", digits, v);
        if (strtod(buf, NULL) == v) break;
    }
    for (char *p = buf; *p; p++)
        if (*p == point) *p = '.';
    return buf;
}

/* Does the value lie in the range, or outside by at most half of its ends? */
static bool is_near_range(double value, double min, double max)
{
    const double around = 0.5 * fmin(fabs(min), fabs(max));
    return value >= min - around && value <= max + around;
}

/* A unit in which a value may have been given by mistake. */
typedef struct other_unit {
    double factor;        /* to the unit of the parameter; 0: there is none */
    const char *question; /* the end of the message */
} other_unit;

static other_unit find_unit(double value, double min, double max, const char *unit)
{
    static const other_unit none = {0, ""}, metres = {1e3, "; was it given in metres? It needs mm"},
                            micrometres = {1e-3, "; was it given in micrometres? It needs mm"},
                            degrees = {0.017453292519943295,
                                       "; was it given in degrees? It needs rad"};
    const double size = fabs(value), low = fmin(fabs(min), fabs(max)),
                 high = fmax(fabs(min), fabs(max));
    if (value >= min && value <= max) return none;
    if (!strcmp(unit, "rad")) {
        const double angle = degrees.factor * value;
        return size > 1.5 * high && size <= 720 && angle >= min && angle <= max ? degrees : none;
    }
    if (strcmp(unit, "mm")) return none;
    if (size < 0.01 * low && is_near_range(1e3 * value, min, max)) return metres;
    if (size > 100 * high && is_near_range(1e-3 * value, min, max)) return micrometres;
    return none;
}

const char *sdm_unit_question(double value, double min, double max, const char *unit)
{
    return find_unit(value, min, max, unit).question;
}

sdm_status sdm_fail_range(const char *name, double value, double min, double max, const char *unit,
                          sdm_error *err)
{
    char v[32], low[32], high[32];
    const char *space = *unit ? " " : "";
    const other_unit other = find_unit(value, min, max, unit);
    char right[128] = "";
    if (other.factor > 0) snprintf(right, sizeof right, ": %.64s=%.4g", name, other.factor * value);
    return sdm_fail(err, SDM_E_RANGE, "parameter '%s' = %s%s%s, allowed %s .. %s%s%s%s%s", name,
                    isnan(value) ? "nan" : sdm_format_real(value, v), space, unit,
                    sdm_format_real(min, low), sdm_format_real(max, high), space, unit,
                    other.question, right);
}

#define WORD_MAX 64

static int smaller(int a, int b) { return a < b ? a : b; }

/* Optimal string alignment distance: the number of insertions, deletions, substitutions and
 * transpositions of neighbours that turn a into b. Only the first WORD_MAX bytes count. */
static int edit_distance(const char *a, const char *b)
{
    const int n = (int)strnlen(a, WORD_MAX), m = (int)strnlen(b, WORD_MAX);
    int row[3][WORD_MAX + 1];
    for (int j = 0; j <= m; j++) row[0][j] = j;
    for (int i = 1; i <= n; i++) {
        int *now = row[i % 3];
        const int *last = row[(i - 1) % 3], *before = row[(i + 1) % 3];
        now[0] = i;
        for (int j = 1; j <= m; j++) {
            now[j] =
                smaller(smaller(last[j] + 1, now[j - 1] + 1), last[j - 1] + (a[i - 1] != b[j - 1]));
            if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
                now[j] = smaller(now[j], before[j - 2] + 1);
        }
    }
    return row[n % 3][m];
}

const char *sdm_list_names(const char *const *names, size_t n, char *buf, size_t size)
{
    size_t used = 0;
    if (size > 0) buf[0] = '\0';
    for (size_t i = 0; i < n; i++) {
        const bool fits = used + strlen(names[i]) + sizeof ", , ..." <= size;
        const int length =
            snprintf(buf + used, size - used, "%s%s", i ? ", " : "", fits ? names[i] : "...");
        if (!fits || length < 0) break;
        used += (size_t)length;
    }
    return buf;
}

bool sdm_is_name(const char *text)
{
    if (!text || !(text[0] >= 'a' && text[0] <= 'z')) return false;
    const size_t n = strspn(text, "abcdefghijklmnopqrstuvwxyz0123456789_");
    return !text[n] && n <= SDM_NAME_LENGTH_MAX;
}

/* Words that resemble no name are completed: a word of at least this many characters stands for the
 * first name that begins with it; with two more, for the first name that begins with all but its
 * last character (`space` for `spacing`). */
enum { SHORTEST_BEGINNING = 3 };

const char *sdm_nearest_name(const char *word, const char *const *names, size_t n)
{
    const int length = (int)strnlen(word, WORD_MAX);
    int best = length < 5 ? 2 : (length + 1) / 3 + 1; // distances must be below this limit
    const char *nearest = NULL;
    for (size_t i = 0; i < n; i++) {
        const int d = edit_distance(word, names[i]);
        if (d < best && (d <= 1 || *word == *names[i])) best = d, nearest = names[i];
    }
    // else the first name that begins with the word
    for (size_t i = 0; i < n && !nearest && length >= SHORTEST_BEGINNING; i++)
        if (!strncmp(word, names[i], (size_t)length)) nearest = names[i];
    for (size_t i = 0; i < n && !nearest && length >= SHORTEST_BEGINNING + 2; i++)
        if (!strncmp(word, names[i], (size_t)length - 1)) nearest = names[i];
    return nearest;
}
