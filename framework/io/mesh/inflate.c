/* Decompression of zlib data. Codes are decoded bit by bit from their counts per length: a code of
 * length n is a symbol when it is smaller than the first code of that length + their count. */
#include "inflate.h"

#include <string.h>

enum { BITS_MAX = 15, LITERALS = 288, DISTANCES = 30 };

typedef struct inflater {
    const uint8_t *in, *in_end;
    uint8_t *out;
    size_t at, n_out; /* bytes written, bytes expected */
    uint32_t bits;    /* bits that were read and not used */
    int n_bits;
    bool failed;
} inflater;

/* A canonical Huffman code: the number of codes of each length, and the symbols in their order. */
typedef struct code {
    uint16_t count[BITS_MAX + 1], symbol[LITERALS];
} code;

static uint32_t take(inflater *z, int n)
{
    while (z->n_bits < n) {
        if (z->in == z->in_end) {
            z->failed = true;
            return 0;
        }
        z->bits |= (uint32_t)*z->in++ << z->n_bits;
        z->n_bits += 8;
    }
    const uint32_t v = z->bits & ((UINT32_C(1) << n) - 1);
    z->bits >>= n;
    z->n_bits -= n;
    return v;
}

/* Builds the code from the lengths of its symbols. Fails when it has more codes than bits allow, or
 * fewer, except for a single code. */
static bool build_code(code *c, const uint8_t *length, int n)
{
    uint16_t first[BITS_MAX + 2] = {0};
    int left = 1;
    memset(c, 0, sizeof *c);
    for (int i = 0; i < n; i++) c->count[length[i]]++;
    const int used = n - c->count[0];
    c->count[0] = 0;
    for (int k = 1; k <= BITS_MAX; k++) {
        left = 2 * left - c->count[k];
        if (left < 0) return false;
        first[k + 1] = (uint16_t)(first[k] + c->count[k]);
    }
    for (int i = 0; i < n; i++)
        if (length[i]) c->symbol[first[length[i]]++] = (uint16_t)i;
    return left == 0 || used <= 1;
}

/* The next symbol, or -1. */
static int decode(inflater *z, const code *c)
{
    int value = 0, first = 0, index = 0;
    for (int k = 1; k <= BITS_MAX; k++) {
        value |= (int)take(z, 1);
        if (z->failed) return -1;
        if (value - c->count[k] < first) return c->symbol[index + (value - first)];
        index += c->count[k];
        first = (first + c->count[k]) << 1;
        value <<= 1;
    }
    z->failed = true;
    return -1;
}

static void copy_stored(inflater *z)
{
    z->bits = 0, z->n_bits = 0;
    if (z->in_end - z->in < 4) {
        z->failed = true;
        return;
    }
    const size_t n = (size_t)z->in[0] | (size_t)z->in[1] << 8,
                 inverse = (size_t)z->in[2] | (size_t)z->in[3] << 8;
    z->in += 4;
    if ((n ^ inverse) != 0xFFFF || n > (size_t)(z->in_end - z->in) || n > z->n_out - z->at) {
        z->failed = true;
        return;
    }
    memcpy(z->out + z->at, z->in, n);
    z->in += n;
    z->at += n;
}

/* Copies a match: `symbol`, its length, comes from the literal code, its distance follows. */
static void copy_match(inflater *z, const code *distances, int symbol)
{
    static const uint16_t length_from[] = {3,  4,  5,  6,   7,   8,   9,   10,  11, 13,
                                           15, 17, 19, 23,  27,  31,  35,  43,  51, 59,
                                           67, 83, 99, 115, 131, 163, 195, 227, 258};
    static const uint8_t length_bits[] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2,
                                          2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
    static const uint16_t distance_from[] = {
        1,   2,   3,   4,   5,   7,    9,    13,   17,   25,   33,   49,   65,    97,    129,
        193, 257, 385, 513, 769, 1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
    symbol -= 257;
    if (symbol > 28) {
        z->failed = true;
        return;
    }
    const size_t length = length_from[symbol] + take(z, length_bits[symbol]);
    const int d = decode(z, distances);
    if (d < 0 || d >= DISTANCES) {
        z->failed = true;
        return;
    }
    const size_t distance = distance_from[d] + take(z, d < 2 ? 0 : d / 2 - 1);
    if (z->failed || distance > z->at || length > z->n_out - z->at) {
        z->failed = true;
        return;
    }
    for (size_t i = 0; i < length; i++, z->at++) z->out[z->at] = z->out[z->at - distance];
}

static void expand(inflater *z, const code *literals, const code *distances)
{
    while (!z->failed) {
        const int symbol = decode(z, literals);
        if (symbol == 256) return;
        if (symbol > 256)
            copy_match(z, distances, symbol);
        else if (symbol < 0 || z->at == z->n_out)
            z->failed = true;
        else
            z->out[z->at++] = (uint8_t)symbol;
    }
}

static void expand_fixed(inflater *z)
{
    uint8_t length[LITERALS];
    code literals, distances;
    for (int i = 0; i < LITERALS; i++) length[i] = i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : 8;
    build_code(&literals, length, LITERALS);
    memset(length, 5, DISTANCES);
    build_code(&distances, length, DISTANCES); // two of 32 codes are not used
    expand(z, &literals, &distances);
}

/* Reads the lengths of n codes, themselves compressed. */
static void read_lengths(inflater *z, const code *lengths, uint8_t *length, int n)
{
    for (int i = 0; i < n && !z->failed;) {
        const int symbol = decode(z, lengths);
        if (symbol < 16) {
            length[i++] = (uint8_t)symbol;
            continue;
        }
        const uint8_t value = symbol == 16 && i > 0 ? length[i - 1] : 0;
        const int times = symbol == 16   ? 3 + (int)take(z, 2)
                          : symbol == 17 ? 3 + (int)take(z, 3)
                                         : 11 + (int)take(z, 7);
        if ((symbol == 16 && i == 0) || times > n - i)
            z->failed = true;
        else
            memset(length + i, value, (size_t)times), i += times;
    }
}

static void expand_dynamic(inflater *z)
{
    static const uint8_t order[] = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                    11, 4,  12, 3, 13, 2, 14, 1, 15};
    uint8_t length[LITERALS + 32] = {0}, short_length[19] = {0};
    code lengths, literals, distances;
    const int n_literal = 257 + (int)take(z, 5), n_distance = 1 + (int)take(z, 5),
              n_length = 4 + (int)take(z, 4);
    for (int i = 0; i < n_length; i++) short_length[order[i]] = (uint8_t)take(z, 3);
    if (z->failed || n_literal > 286 || n_distance > DISTANCES ||
        !build_code(&lengths, short_length, 19)) {
        z->failed = true;
        return;
    }
    read_lengths(z, &lengths, length, n_literal + n_distance);
    if (z->failed || !length[256] || !build_code(&literals, length, n_literal) ||
        !build_code(&distances, length + n_literal, n_distance)) {
        z->failed = true;
        return;
    }
    expand(z, &literals, &distances);
}

static uint32_t adler32(const uint8_t *p, size_t n)
{
    uint32_t a = 1, b = 0;
    while (n > 0) {
        const size_t part = n < 5552 ? n : 5552; // the sums stay below 2^32
        for (size_t i = 0; i < part; i++) a += p[i], b += a;
        a %= 65521, b %= 65521;
        p += part, n -= part;
    }
    return b << 16 | a;
}

bool sdm_inflate(const uint8_t *in, size_t n_in, uint8_t *out, size_t n_out)
{
    // method 8, a window of at most 32 KiB, no dictionary
    if (n_in < 6 || (in[0] & 15) != 8 || in[0] >> 4 > 7 || (in[0] * 256 + in[1]) % 31 != 0 ||
        (in[1] & 32))
        return false;
    inflater z = {.in = in + 2, .in_end = in + n_in - 4, .out = out, .n_out = n_out};
    bool last = false;
    while (!last && !z.failed) {
        last = take(&z, 1);
        const uint32_t kind = take(&z, 2);
        if (z.failed || kind == 3) return false;
        if (kind == 0)
            copy_stored(&z);
        else if (kind == 1)
            expand_fixed(&z);
        else
            expand_dynamic(&z);
    }
    if (z.failed || z.at != n_out || z.in != z.in_end) return false;
    const uint8_t *sum = z.in_end;
    return adler32(out, n_out) ==
           ((uint32_t)sum[0] << 24 | (uint32_t)sum[1] << 16 | (uint32_t)sum[2] << 8 | sum[3]);
}
