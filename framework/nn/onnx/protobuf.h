/* Messages in the encoding of Protocol Buffers: a field is a tag (number and type of the field) and
   a value; a message inside a message is a field with its length. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* The bytes of a message. Zero-initialise it; sdm_proto_dispose() frees it. If memory runs out,
   `failed` is set, and later calls do nothing, so one check at the end suffices. */
typedef struct sdm_proto {
    uint8_t *data;
    size_t size, capacity;
    bool failed;
} sdm_proto;

void sdm_proto_dispose(sdm_proto *p);

/* Appends a field: an integer; a float; bytes[size]; a text that ends with NUL; a message. */
void sdm_proto_int(sdm_proto *p, unsigned field, uint64_t v);
void sdm_proto_float(sdm_proto *p, unsigned field, float v);
void sdm_proto_bytes(sdm_proto *p, unsigned field, const void *bytes, size_t size);
void sdm_proto_text(sdm_proto *p, unsigned field, const char *text);
void sdm_proto_message(sdm_proto *p, unsigned field, const sdm_proto *message);

/* Appends the tag and the length of a field of `size` bytes, which follow elsewhere. */
void sdm_proto_head(sdm_proto *p, unsigned field, uint64_t size);

/* Appends the fields of another message. */
void sdm_proto_append(sdm_proto *p, const sdm_proto *fields);
