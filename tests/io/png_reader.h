/* A small decoder for the 8-bit RGB PNG files that cairo writes, for tests of pictures. */
#ifndef TESTS_PNG_READER_H
#define TESTS_PNG_READER_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <zlib.h>

typedef struct picture {
    int w, h;
    unsigned char *rgb;
} picture;

static unsigned big_endian_at(const unsigned char *p)
{
    return (unsigned)p[0] << 24 | (unsigned)p[1] << 16 | (unsigned)p[2] << 8 | p[3];
}

/* Undoes the filter of each line (PNG specification, 9.2). */
static void unfilter(const unsigned char *raw, picture *p)
{
    const size_t size = 3 * (size_t)p->w;
    for (int y = 0; y < p->h; y++) {
        const unsigned char *in = raw + (size_t)y * (size + 1);
        unsigned char *out = p->rgb + (size_t)y * size;
        assert_true(in[0] < 5);
        for (size_t i = 0; i < size; i++) {
            const int a = i >= 3 ? out[i - 3] : 0, b = y ? out[i - size] : 0,
                      c = y && i >= 3 ? out[i - size - 3] : 0;
            const int pa = abs(b - c), pb = abs(a - c), pc = abs(a + b - 2 * c);
            const int guess = in[0] == 0   ? 0
                              : in[0] == 1 ? a
                              : in[0] == 2 ? b
                              : in[0] == 3 ? (a + b) / 2
                                           : (pa <= pb && pa <= pc ? a
                                              : pb <= pc           ? b
                                                                   : c);
            out[i] = (unsigned char)(in[i + 1] + guess);
        }
    }
}

/* Reads a picture; the caller frees rgb. Fails the test if the file is damaged or not 8-bit RGB. */
static picture read_png(const char *path)
{
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    unsigned char *data = malloc(1 << 24), *packed = malloc(1 << 24);
    assert_true(data && packed);
    const size_t n = fread(data, 1, 1 << 24, f);
    fclose(f);
    assert_memory_equal(data, "\x89PNG\r\n\x1a\n", 8);
    picture p = {0};
    size_t n_packed = 0, at = 8;
    int ended = 0;
    while (at < n) {
        const size_t size = big_endian_at(data + at);
        const unsigned char *type = data + at + 4;
        assert_true(!ended && at + 12 + size <= n);
        assert_int_equal(big_endian_at(type + 4 + size), crc32(0, type, (unsigned)size + 4));
        if (memcmp(type, "IHDR", 4) == 0) {
            assert_int_equal(size, 13);
            p.w = (int)big_endian_at(type + 4);
            p.h = (int)big_endian_at(type + 8);
            assert_memory_equal(type + 12, "\x08\x02\x00\x00\x00", 5);
        }
        if (memcmp(type, "IDAT", 4) == 0) {
            memcpy(packed + n_packed, type + 4, size);
            n_packed += size;
        }
        ended = memcmp(type, "IEND", 4) == 0;
        at += 12 + size;
    }
    assert_true(ended);
    uLongf n_raw = (uLongf)p.h * (3 * (uLongf)p.w + 1);
    const uLongf wanted = n_raw;
    unsigned char *raw = malloc(n_raw);
    p.rgb = malloc(n_raw);
    assert_true(raw && p.rgb);
    assert_int_equal(uncompress(raw, &n_raw, packed, (uLong)n_packed), Z_OK);
    assert_int_equal(n_raw, wanted);
    unfilter(raw, &p);
    free(raw);
    free(data);
    free(packed);
    return p;
}

#endif
