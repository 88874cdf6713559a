/* Writes and reads the lines of a model's description. */
#include "model_text.h"

#include <stdio.h>
#include <string.h>

void sdm_text_add_real(sdm_text *t, const char *key, double v)
{
    char buf[32];
    sdm_text_add(t, "%s=%s\n", key, sdm_format_real(v, buf));
}

void sdm_text_add_reals(sdm_text *t, const char *key, const double *v, size_t n)
{
    char buf[32];
    sdm_text_add(t, "%s=", key);
    for (size_t i = 0; i < n; i++)
        sdm_text_add(t, "%s%s", i ? " " : "", sdm_format_real(v[i], buf));
    sdm_text_add(t, "\n");
}

bool sdm_lines_next_is(const sdm_lines *r, const char *key)
{
    const size_t n = strlen(key);
    return !r->failed && (size_t)(r->end - r->at) > n && !memcmp(r->at, key, n) && r->at[n] == '=';
}

const char *sdm_lines_value(sdm_lines *r, const char *key)
{
    const size_t n = strlen(key);
    if (r->failed) return "";
    snprintf(r->key, sizeof r->key, "%s", key);
    const char *line_end = r->at < r->end ? memchr(r->at, '\n', (size_t)(r->end - r->at)) : NULL;
    r->failed = !line_end || (size_t)(line_end - r->at) < n + 1 || memcmp(r->at, key, n) ||
                r->at[n] != '=' || (size_t)(line_end - r->at) - n - 1 >= sizeof r->value;
    if (r->failed) return "";
    const size_t length = (size_t)(line_end - r->at) - n - 1;
    memcpy(r->value, r->at + n + 1, length);
    r->value[length] = '\0';
    r->at = line_end + 1;
    return r->value;
}

void sdm_lines_reals(sdm_lines *r, const char *key, double *out, size_t n)
{
    sdm_lines_value(r, key);
    char *word = r->value;
    for (size_t i = 0; i < n && !r->failed; i++) {
        char *space = strchr(word, ' ');
        if (space) *space = '\0';
        r->failed = (i + 1 < n) != (space != NULL) || !sdm_parse_real(word, &out[i]);
        word = space ? space + 1 : word;
    }
}

double sdm_lines_real(sdm_lines *r, const char *key)
{
    double v = 0;
    sdm_lines_reals(r, key, &v, 1);
    return v;
}

int64_t sdm_lines_int(sdm_lines *r, const char *key, int64_t min, int64_t max)
{
    int64_t v = min;
    sdm_lines_value(r, key);
    if (!r->failed) r->failed = !sdm_parse_int(r->value, &v) || v < min || v > max;
    return r->failed ? min : v;
}

void sdm_lines_text(sdm_lines *r, const char *key, char *out, size_t size)
{
    sdm_lines_value(r, key);
    if (!r->failed) r->failed = strlen(r->value) >= size;
    snprintf(out, size, "%.*s", (int)size - 1, r->failed ? "" : r->value);
}

sdm_status sdm_lines_check(const sdm_lines *r, sdm_error *err)
{
    if (!r->failed) return SDM_OK;
    return sdm_fail(err, SDM_E_FORMAT, "damaged: the description lacks a valid '%s'", r->key);
}
