/* Reads JSON from memory into a flat list of values. */
#include "sdm/internal/json_read.h"

#include <stdlib.h>
#include <string.h>

#include "sdm/internal/text.h"
#include "sdm/memory.h"

enum { DEPTH_MAX = 64, NUMBER_MAX = 64 };

typedef struct parser {
    const char *name, *start, *at, *end;
    sdm_json_document *out;
    sdm_error *err;
} parser;

static sdm_status fail_here(const parser *p, const char *what)
{
    size_t line = 1;
    for (const char *c = p->start; c < p->at; c++) line += *c == '\n';
    return sdm_fail(p->err, SDM_E_FORMAT, "%s:%zu: JSON: %s", p->name, line, what);
}

static void skip_blanks(parser *p)
{
    while (p->at < p->end && (*p->at == ' ' || *p->at == '\t' || *p->at == '\n' || *p->at == '\r'))
        p->at++;
}

/* Appends a value; *index is its place. */
static sdm_status add(parser *p, char kind, size_t *index)
{
    sdm_json_document *d = p->out;
    if (d->n == d->capacity) {
        sdm_json_value *more = NULL;
        const size_t capacity = d->capacity ? d->capacity + d->capacity / 2 : 256;
        const sdm_status s = SDM_ALLOC(&more, capacity, "values of JSON", p->err);
        if (s) return s;
        if (d->n > 0) memcpy(more, d->values, d->n * sizeof *more);
        sdm_free(d->values);
        d->values = more;
        d->capacity = capacity;
    }
    *index = d->n++;
    d->values[*index] = (sdm_json_value){.at = p->at, .kind = kind, .next = d->n};
    return SDM_OK;
}

static sdm_status parse_string(parser *p)
{
    size_t i;
    p->at++;
    const sdm_status s = add(p, '"', &i);
    if (s) return s;
    const char *from = p->at;
    for (; p->at < p->end && *p->at != '"'; p->at++) {
        if ((unsigned char)*p->at < 0x20) return fail_here(p, "a control character in a string");
        if (*p->at == '\\' && ++p->at == p->end) break;
    }
    if (p->at >= p->end) return fail_here(p, "a string does not end");
    p->out->values[i].size = (size_t)(p->at++ - from);
    return SDM_OK;
}

/* A number, or one of the words true, false and null. */
static sdm_status parse_word(parser *p)
{
    static const char *const words[] = {"true", "false", "null"};
    const char *from = p->at;
    size_t n = strspn(from, "+-0123456789.eE"), i;
    char text[NUMBER_MAX], kind = '0';
    double v;
    for (int k = 0; k < 3 && n == 0; k++)
        if (!strncmp(from, words[k], strlen(words[k]))) kind = words[k][0], n = strlen(words[k]);
    if (n == 0 || n >= sizeof text || n > (size_t)(p->end - from))
        return fail_here(p, "need a value");
    memcpy(text, from, n);
    text[n] = '\0';
    if (kind == '0' && !sdm_parse_real(text, &v)) return fail_here(p, "not a finite number");
    const sdm_status s = add(p, kind, &i);
    if (!s) p->out->values[i].size = n;
    p->at += n;
    return s;
}

static sdm_status parse_value(parser *p, int depth);

static sdm_status parse_key(parser *p)
{
    skip_blanks(p);
    if (p->at == p->end || *p->at != '"') return fail_here(p, "need a key in quotes");
    const sdm_status s = parse_string(p);
    if (s) return s;
    skip_blanks(p);
    if (p->at == p->end || *p->at != ':') return fail_here(p, "need ':' after a key");
    p->at++;
    return SDM_OK;
}

/* An object or an array. */
static sdm_status parse_list(parser *p, int depth)
{
    const char kind = *p->at, close = kind == '{' ? '}' : ']';
    size_t i;
    if (depth == DEPTH_MAX) return fail_here(p, "values nest too deeply");
    sdm_status s = add(p, kind, &i);
    p->at++;
    skip_blanks(p);
    bool more = p->at < p->end && *p->at != close;
    while (!s && more) {
        if (kind == '{') s = parse_key(p);
        if (!s) s = parse_value(p, depth + 1);
        if (s) return s;
        skip_blanks(p);
        more = p->at < p->end && *p->at == ',';
        if (more) p->at++;
    }
    if (s) return s;
    if (p->at == p->end || *p->at != close) return fail_here(p, "a list does not end");
    p->at++;
    p->out->values[i].next = p->out->n;
    return SDM_OK;
}

static sdm_status parse_value(parser *p, int depth)
{
    skip_blanks(p);
    if (p->at == p->end) return fail_here(p, "the text ends too early");
    if (*p->at == '{' || *p->at == '[') return parse_list(p, depth);
    return *p->at == '"' ? parse_string(p) : parse_word(p);
}

sdm_status sdm_json_parse(const char *name, const char *text, size_t size, sdm_json_document *out,
                          sdm_error *err)
{
    parser p = {
        .name = name, .start = text, .at = text, .end = text + size, .out = out, .err = err};
    sdm_status s = parse_value(&p, 0);
    skip_blanks(&p);
    if (!s && p.at != p.end) s = fail_here(&p, "more text after the document");
    if (s) sdm_json_document_dispose(out);
    return s;
}

void sdm_json_document_dispose(sdm_json_document *d)
{
    sdm_free(d->values);
    *d = (sdm_json_document){0};
}

bool sdm_json_is(const sdm_json_document *d, size_t i, const char *text)
{
    const sdm_json_value *v = &d->values[i];
    return v->kind == '"' && v->size == strlen(text) && !memcmp(v->at, text, v->size);
}

size_t sdm_json_member(const sdm_json_document *d, size_t i, const char *key)
{
    if (d->values[i].kind != '{') return 0;
    for (size_t k = i + 1; k < d->values[i].next; k = d->values[k + 1].next)
        if (sdm_json_is(d, k, key)) return k + 1;
    return 0;
}

bool sdm_json_number(const sdm_json_document *d, size_t i, double *out)
{
    const sdm_json_value *v = &d->values[i];
    char text[NUMBER_MAX];
    if (v->kind != '0' || v->size >= sizeof text) return false;
    memcpy(text, v->at, v->size);
    text[v->size] = '\0';
    return sdm_parse_real(text, out);
}

/* The character of the escape at `at`, behind its backslash; *length = characters of the escape. */
static char unescape(const char *at, size_t left, size_t *length)
{
    static const char letters[] = "bfnrt", values[] = "\b\f\n\r\t";
    *length = 1;
    if (*at == 'u') {
        char digits[5] = "";
        *length = left < 5 ? left : 5;
        memcpy(digits, at + 1, *length - 1);
        const long code = strtol(digits, NULL, 16);
        return code > 0 && code < 128 ? (char)code : '?';
    }
    const char *letter = strchr(letters, *at);
    return letter ? values[letter - letters] : *at;
}

bool sdm_json_word(const sdm_json_document *d, size_t i, char *buf, size_t size)
{
    const sdm_json_value *v = &d->values[i];
    size_t n = 0, length;
    if (v->kind != '"') return false;
    for (size_t k = 0; k < v->size; k++) {
        if (n + 1 >= size) return false;
        if (v->at[k] != '\\' || k + 1 == v->size) {
            buf[n++] = v->at[k];
            continue;
        }
        buf[n++] = unescape(v->at + k + 1, v->size - k - 1, &length);
        k += length;
    }
    buf[n] = '\0';
    return true;
}
