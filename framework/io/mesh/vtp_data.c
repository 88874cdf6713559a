/* The bytes of a DataArray of a .vtp file. */
#include "vtp_data.h"

#include "bytes.h"
#include "inflate.h"
#include "sdm/memory.h"

/* zlib makes at most 1032 bytes of one */
#define RATIO_MAX 1032

static sdm_status fail_here(const sdm_vtp_source *d, const char *what, sdm_error *err)
{
    return sdm_fail(err, SDM_E_FORMAT, "%s: byte %zu: %s", d->path, (size_t)(d->at - d->start),
                    what);
}

/* The value of a character of base64; -1: the padding '='; -2: none. */
static int base64_value(uint8_t c)
{
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    return c == '+' ? 62 : c == '/' ? 63 : c == '=' ? -1 : -2;
}

/* An upper limit of the bytes that are left. */
static size_t bytes_left(const sdm_vtp_source *d)
{
    const size_t n = (size_t)(d->end - d->at);
    return d->base64 ? n / 4 * 3 : n;
}

/* Bytes that a group of four characters gave and that have not been used. */
typedef struct group {
    uint8_t bytes[3];
    int n, used;
} group;

/* Decodes the next four characters. Padding may stand in the middle of the data: VTK encodes the
 * header of compressed arrays on its own. */
static bool next_group(sdm_vtp_source *d, group *g)
{
    uint32_t v = 0;
    int n = 0, padding = 0;
    while (n < 4 && d->at < d->end) {
        const uint8_t c = *d->at;
        if (c <= ' ') {
            d->at++;
            continue;
        }
        const int value = base64_value(c);
        if (value == -2 || (value >= 0 && padding)) return false;
        padding += value < 0;
        v = v << 6 | (uint32_t)(value < 0 ? 0 : value);
        d->at++, n++;
    }
    if (n < 4 || padding > 2) return false;
    for (int i = 0; i < 3; i++) g->bytes[i] = (uint8_t)(v >> (16 - 8 * i));
    g->n = 3 - padding;
    g->used = 0;
    return true;
}

static sdm_status read_bytes(sdm_vtp_source *d, group *g, uint8_t *out, size_t n, sdm_error *err)
{
    if (!d->base64) {
        if (n > bytes_left(d)) return fail_here(d, "the file ends inside an array", err);
        memcpy(out, d->at, n);
        d->at += n;
        return SDM_OK;
    }
    for (size_t i = 0; i < n; i++) {
        if (g->used == g->n && !next_group(d, g))
            return fail_here(d, "damaged or incomplete base64", err);
        out[i] = g->bytes[g->used++];
    }
    return SDM_OK;
}

static sdm_status read_number(sdm_vtp_source *d, group *g, uint64_t *out, sdm_error *err)
{
    uint8_t bytes[8];
    const sdm_status s = read_bytes(d, g, bytes, d->header_size, err);
    if (!s) *out = sdm_get_uint(bytes, d->header_size, d->big);
    return s;
}

static sdm_status read_whole(sdm_vtp_source *d, uint8_t **bytes, size_t *size, sdm_error *err)
{
    group g = {0};
    uint64_t n;
    sdm_status s = read_number(d, &g, &n, err);
    if (!s && n > bytes_left(d) + 3) s = fail_here(d, "an array is longer than the file", err);
    if (!s) s = SDM_ALLOC(bytes, (size_t)n, "array of a VTK file", err);
    if (!s) s = read_bytes(d, &g, *bytes, (size_t)n, err);
    *size = s ? 0 : (size_t)n;
    return s;
}

/* The header of a compressed array: number of blocks, their size, the size of the last one if it is
 * smaller, the compressed size of each. */
typedef struct blocks {
    uint64_t n, size, last;
    uint64_t *packed; /* [n] */
    uint64_t total, packed_max;
} blocks;

static sdm_status read_blocks(sdm_vtp_source *d, blocks *k, sdm_error *err)
{
    group g = {0};
    sdm_status s = read_number(d, &g, &k->n, err);
    if (!s) s = read_number(d, &g, &k->size, err);
    if (!s) s = read_number(d, &g, &k->last, err);
    if (!s && k->n > (bytes_left(d) + 3) / d->header_size)
        s = fail_here(d, "more compressed blocks than the file can hold", err);
    if (!s) s = SDM_ALLOC(&k->packed, (size_t)k->n, "block sizes of a VTK file", err);
    const uint64_t left = bytes_left(d) + 3; // as far as base64 tells
    uint64_t packed = 0;
    for (uint64_t i = 0; i < k->n && !s; i++) {
        s = read_number(d, &g, &k->packed[i], err);
        if (!s && k->packed[i] > left - packed)
            s = fail_here(d, "the compressed blocks are longer than the file", err);
        if (s) break;
        packed += k->packed[i];
        if (k->packed[i] > k->packed_max) k->packed_max = k->packed[i];
    }
    if (s || k->n == 0) return s;
    if (k->last > k->size || k->size > RATIO_MAX * left || (k->n - 1) * k->size > RATIO_MAX * left)
        return fail_here(d, "an array is longer than the compressed data can be", err);
    k->total = k->last ? (k->n - 1) * k->size + k->last : k->n * k->size;
    return SDM_OK;
}

static sdm_status read_compressed(sdm_vtp_source *d, uint8_t **bytes, size_t *size, sdm_error *err)
{
    blocks k = {0};
    group g = {0};
    uint8_t *packed = NULL;
    sdm_status s = read_blocks(d, &k, err);
    if (!s) s = SDM_ALLOC(bytes, (size_t)k.total, "array of a VTK file", err);
    if (!s) s = SDM_ALLOC(&packed, (size_t)k.packed_max, "compressed array of a VTK file", err);
    size_t at = 0;
    for (uint64_t i = 0; i < k.n && !s; i++) {
        const size_t n = (size_t)(i + 1 == k.n && k.last ? k.last : k.size);
        s = read_bytes(d, &g, packed, (size_t)k.packed[i], err);
        if (!s && !sdm_inflate(packed, (size_t)k.packed[i], *bytes + at, n))
            s = fail_here(d, "damaged zlib data before this byte", err);
        at += n;
    }
    sdm_free(packed);
    sdm_free(k.packed);
    *size = s ? 0 : (size_t)k.total;
    return s;
}

sdm_status sdm_vtp_bytes(sdm_vtp_source *d, uint8_t **bytes, size_t *size, sdm_error *err)
{
    *bytes = NULL;
    const sdm_status s =
        d->compressed ? read_compressed(d, bytes, size, err) : read_whole(d, bytes, size, err);
    if (!s) return SDM_OK;
    sdm_free(*bytes);
    *bytes = NULL;
    return s;
}
