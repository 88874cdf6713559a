/* Walks over the tags of an XML text: the small part of XML that VTK files use. Strict: elements
 * must nest, attributes are quoted; document types and CDATA are refused. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

enum { SDM_TAG_DEPTH_MAX = 16 };

/* A piece of the text. */
typedef struct sdm_span {
    const char *at;
    size_t size;
} sdm_span;

typedef struct sdm_tags {
    /* set before the first call; the rest is 0 */
    const char *path, *start, *at, *end;
    /* the tag that was read last: its name, its attributes, whether it closes an element; an
       element without content, <a/>, opens and closes in one tag */
    sdm_span name, attributes;
    bool closes, empty;
    /* names of the open elements */
    sdm_span open[SDM_TAG_DEPTH_MAX];
    int depth;
} sdm_tags;

/* Moves to the next tag; *more is false when the root element has been closed. SDM_E_FORMAT. */
sdm_status sdm_tags_next(sdm_tags *tags, bool *more, sdm_error *err);

/* The value of an attribute of the last tag; at = NULL: there is none. */
sdm_span sdm_tags_attribute(const sdm_tags *tags, const char *name);

bool sdm_span_is(sdm_span span, const char *text);

/* The span as a whole number of 0 .. 2^62; false for anything else. */
bool sdm_span_count(sdm_span span, uint64_t *out);

/* SDM_E_FORMAT at the current byte. */
sdm_status sdm_tags_fail(const sdm_tags *tags, const char *what, sdm_error *err);
