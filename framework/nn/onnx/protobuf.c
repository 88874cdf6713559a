/* Appends fields to messages in the encoding of Protocol Buffers. */
#include "protobuf.h"

#include <string.h>

#include "sdm/memory.h"

enum { VARINT = 0, LENGTH = 2, FIXED32 = 5 };

void sdm_proto_dispose(sdm_proto *p)
{
    sdm_free(p->data);
    *p = (sdm_proto){0};
}

static void append(sdm_proto *p, const void *bytes, size_t size)
{
    if (p->failed || !size) return;
    if (size > p->capacity - p->size) {
        const size_t capacity = 2 * (p->size + size) + 64;
        uint8_t *grown;
        if (size > SIZE_MAX / 4 - p->size ||
            sdm_alloc((void **)&grown, capacity, 1, "message", NULL)) {
            p->failed = true;
            return;
        }
        if (p->size) memcpy(grown, p->data, p->size);
        sdm_free(p->data);
        p->data = grown;
        p->capacity = capacity;
    }
    memcpy(p->data + p->size, bytes, size);
    p->size += size;
}

// seven bits a byte, the lowest first; the highest bit tells that more follow
static void append_varint(sdm_proto *p, uint64_t v)
{
    uint8_t bytes[10];
    size_t n = 0;
    for (; v > 127; v >>= 7) bytes[n++] = (uint8_t)(v | 128);
    bytes[n++] = (uint8_t)v;
    append(p, bytes, n);
}

void sdm_proto_int(sdm_proto *p, unsigned field, uint64_t v)
{
    append_varint(p, field << 3 | VARINT);
    append_varint(p, v);
}

void sdm_proto_float(sdm_proto *p, unsigned field, float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    const uint8_t bytes[] = {(uint8_t)bits, (uint8_t)(bits >> 8), (uint8_t)(bits >> 16),
                             (uint8_t)(bits >> 24)};
    append_varint(p, field << 3 | FIXED32);
    append(p, bytes, sizeof bytes);
}

void sdm_proto_head(sdm_proto *p, unsigned field, uint64_t size)
{
    append_varint(p, field << 3 | LENGTH);
    append_varint(p, size);
}

void sdm_proto_bytes(sdm_proto *p, unsigned field, const void *bytes, size_t size)
{
    sdm_proto_head(p, field, size);
    append(p, bytes, size);
}

void sdm_proto_text(sdm_proto *p, unsigned field, const char *text)
{
    sdm_proto_bytes(p, field, text, strlen(text));
}

void sdm_proto_message(sdm_proto *p, unsigned field, const sdm_proto *message)
{
    p->failed |= message->failed;
    sdm_proto_bytes(p, field, message->data, message->size);
}

void sdm_proto_append(sdm_proto *p, const sdm_proto *fields)
{
    p->failed |= fields->failed;
    append(p, fields->data, fields->size);
}
