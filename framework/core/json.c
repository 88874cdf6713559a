/* JSON writer (sdm/internal/text.h). */
#include <math.h>
#include <string.h>

#include "sdm/internal/text.h"
#include "sdm/internal/utf8.h"

/* JSON is UTF-8: bytes that are not become U+FFFD. DEL is legal, and commands a terminal. */
static void json_quote(sdm_text *t, const char *s)
{
    sdm_text_add(t, "\"");
    for (; *s; s++) {
        const unsigned char c = (unsigned char)*s;
        const size_t n = sdm_utf8_length(s);
        if (n != 1) {
            sdm_text_add(t, "%.*s", n ? (int)n : 3, n ? s : "\xEF\xBF\xBD");
            s += n ? n - 1 : 0;
            continue;
        }
        if (c == '"' || c == '\\')
            sdm_text_add(t, "\\%c", c);
        else if (c == '\n')
            sdm_text_add(t, "\\n");
        else if (c < 0x20 || c == 0x7F)
            sdm_text_add(t, "\\u%04x", c);
        else
            sdm_text_add(t, "%c", c);
    }
    sdm_text_add(t, "\"");
}

static void json_begin(sdm_json *j, const char *key)
{
    if (j->needs_comma[j->depth]) sdm_text_add(&j->text, ", ");
    j->needs_comma[j->depth] = true;
    if (!key) return;
    json_quote(&j->text, key);
    sdm_text_add(&j->text, ": ");
}

void sdm_json_open(sdm_json *j, const char *key, char bracket)
{
    json_begin(j, key);
    sdm_text_add(&j->text, "%c", bracket);
    if (j->depth + 1 == (int)(sizeof j->needs_comma / sizeof *j->needs_comma)) {
        j->text.failed = true;
        return;
    }
    j->needs_comma[++j->depth] = false;
}

void sdm_json_close(sdm_json *j, char bracket)
{
    sdm_text_add(&j->text, "%c", bracket);
    if (j->depth) j->depth--;
}

void sdm_json_real(sdm_json *j, const char *key, double v)
{
    char buf[32];
    json_begin(j, key);
    sdm_text_add(&j->text, "%s", isfinite(v) ? sdm_format_real(v, buf) : "null");
}

void sdm_json_int(sdm_json *j, const char *key, int64_t v)
{
    json_begin(j, key);
    sdm_text_add(&j->text, "%lld", (long long)v);
}

void sdm_json_uint(sdm_json *j, const char *key, uint64_t v)
{
    json_begin(j, key);
    sdm_text_add(&j->text, "%llu", (unsigned long long)v);
}

void sdm_json_bool(sdm_json *j, const char *key, bool v)
{
    json_begin(j, key);
    sdm_text_add(&j->text, v ? "true" : "false");
}

void sdm_json_text(sdm_json *j, const char *key, const char *v)
{
    json_begin(j, key);
    json_quote(&j->text, v);
}

void sdm_json_dispose(sdm_json *j)
{
    if (!j) return;
    sdm_text_dispose(&j->text);
    *j = (sdm_json){0};
}
