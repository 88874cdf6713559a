/* Walks over the tags of an XML text. */
#include "vtp_tags.h"

#include <string.h>

bool sdm_span_is(sdm_span span, const char *text)
{
    return span.at && span.size == strlen(text) && !memcmp(span.at, text, span.size);
}

bool sdm_span_count(sdm_span span, uint64_t *out)
{
    *out = 0;
    for (size_t i = 0; i < span.size; i++) {
        if (span.at[i] < '0' || span.at[i] > '9' || *out > (UINT64_C(1) << 62) / 10 - 1)
            return false;
        *out = 10 * *out + (uint64_t)(span.at[i] - '0');
    }
    return span.size > 0;
}

sdm_status sdm_tags_fail(const sdm_tags *tags, const char *what, sdm_error *err)
{
    return sdm_fail(err, SDM_E_FORMAT, "%s: byte %zu: %s", tags->path,
                    (size_t)(tags->at - tags->start), what);
}

static bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\n' || c == '\r'; }

static bool is_name(char c)
{
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           c == '-' || c == '.' || c == ':';
}

/* The position behind the next `text`, or NULL. */
static const char *behind(const char *at, const char *end, const char *text)
{
    const size_t n = strlen(text);
    for (; (size_t)(end - at) >= n; at++)
        if (!memcmp(at, text, n)) return at + n;
    return NULL;
}

/* Moves to the next tag that is no comment and no instruction; *found is false at the end. */
static sdm_status find_tag(sdm_tags *t, bool *found, sdm_error *err)
{
    for (;;) {
        const char *at = memchr(t->at, '<', (size_t)(t->end - t->at));
        *found = at && t->end - at >= 2;
        if (!*found) return SDM_OK;
        t->at = at;
        const bool comment = t->end - at >= 4 && !memcmp(at, "<!--", 4);
        if (!comment && at[1] == '!')
            return sdm_tags_fail(t, "document types and CDATA are not read", err);
        if (!comment && at[1] != '?') return SDM_OK;
        t->at = comment ? behind(at + 4, t->end, "-->") : behind(at + 2, t->end, "?>");
        if (!t->at) {
            t->at = at;
            return sdm_tags_fail(t, "a comment or an instruction does not end", err);
        }
    }
}

/* Reads `name="value"` up to the end of the tag. */
static sdm_status read_attributes(sdm_tags *t, sdm_error *err)
{
    t->attributes.at = t->at;
    while (t->at < t->end && *t->at != '>' && *t->at != '/') {
        while (t->at < t->end && is_blank(*t->at)) t->at++;
        if (t->at == t->end || !is_name(*t->at)) break;
        while (t->at < t->end && is_name(*t->at)) t->at++;
        if (t->end - t->at < 2 || t->at[0] != '=' || (t->at[1] != '"' && t->at[1] != '\''))
            return sdm_tags_fail(t, "need =\"value\" after the name of an attribute", err);
        const char quote = t->at[1];
        const char *stop = memchr(t->at + 2, quote, (size_t)(t->end - t->at - 2));
        if (!stop) return sdm_tags_fail(t, "the value of an attribute does not end", err);
        t->at = stop + 1;
    }
    t->attributes.size = (size_t)(t->at - t->attributes.at);
    return SDM_OK;
}

/* Keeps the list of open elements. */
static sdm_status nest(sdm_tags *t, sdm_error *err)
{
    if (t->closes) {
        const sdm_span *open = t->depth > 0 ? &t->open[t->depth - 1] : NULL;
        if (!open || open->size != t->name.size || memcmp(open->at, t->name.at, open->size) != 0)
            return sdm_tags_fail(t, "an element is closed that is not the last one opened", err);
        t->depth--;
    } else if (!t->empty) {
        if (t->depth == SDM_TAG_DEPTH_MAX) return sdm_tags_fail(t, "elements nest too deeply", err);
        t->open[t->depth++] = t->name;
    }
    return SDM_OK;
}

sdm_status sdm_tags_next(sdm_tags *t, bool *more, sdm_error *err)
{
    const bool begun = t->name.at != NULL;
    *more = !(begun && t->depth == 0);
    if (!*more) return SDM_OK;
    bool found;
    sdm_status s = find_tag(t, &found, err);
    if (s) return s;
    if (!found)
        return sdm_tags_fail(t, begun ? "the file ends inside an element" : "not XML: no tag", err);
    t->at++;
    t->closes = *t->at == '/';
    if (t->closes) t->at++;
    t->name.at = t->at;
    while (t->at < t->end && is_name(*t->at)) t->at++;
    t->name.size = (size_t)(t->at - t->name.at);
    if (t->name.size == 0) return sdm_tags_fail(t, "a tag without a name", err);
    s = read_attributes(t, err);
    if (s) return s;
    t->empty = t->at < t->end && *t->at == '/';
    if (t->empty) t->at++;
    if (t->at == t->end || *t->at != '>' || (t->closes && t->empty))
        return sdm_tags_fail(t, "a tag does not end with '>'", err);
    t->at++;
    return nest(t, err);
}

sdm_span sdm_tags_attribute(const sdm_tags *t, const char *name)
{
    const char *at = t->attributes.at, *end = at + t->attributes.size;
    while (at < end) {
        while (at < end && is_blank(*at)) at++;
        const char *key = at;
        while (at < end && *at != '=') at++;
        if (end - at < 2) break;
        const sdm_span found = {key, (size_t)(at - key)};
        const char *value = at + 2, *stop = memchr(value, at[1], (size_t)(end - value));
        if (sdm_span_is(found, name)) return (sdm_span){value, (size_t)(stop - value)};
        at = stop + 1;
    }
    return (sdm_span){0};
}
