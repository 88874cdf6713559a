/* Image files assembled byte by byte, independent of the library's writers, for tests of its
 * readers. */
#ifndef SDM_TEST_VOLUME_FILES_H
#define SDM_TEST_VOLUME_FILES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <zlib.h>

#include "sdm/volume.h"

enum { FILE_MAX = 1 << 16 };

/* A file that is being assembled. */
typedef struct bytes {
    unsigned char data[FILE_MAX];
    size_t size;
} bytes;

static inline void put_file(const char *path, const void *data, size_t size)
{
    FILE *f = fopen(path, "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(data, 1, size, f), size);
    assert_int_equal(fclose(f), 0);
}

static inline void add(bytes *b, const void *data, size_t size)
{
    assert_true(b->size + size <= FILE_MAX);
    memcpy(b->data + b->size, data, size);
    b->size += size;
}

static inline void add_text(bytes *b, const char *fmt, ...)
{
    char line[4096];
    va_list args;
    va_start(args, fmt);
    const int n = vsnprintf(line, sizeof line, fmt, args);
    va_end(args);
    assert_true(n >= 0 && n < (int)sizeof line);
    add(b, line, (size_t)n);
}

/* Appends data compressed by zlib. window 31: gzip, 15: zlib format. */
static inline void add_zipped(bytes *b, const void *data, size_t size, int window)
{
    z_stream z = {.next_in = (z_const Bytef *)data, .avail_in = (uInt)size};
    assert_int_equal(deflateInit2(&z, 9, Z_DEFLATED, window, 8, Z_DEFAULT_STRATEGY), Z_OK);
    z.next_out = b->data + b->size;
    z.avail_out = (uInt)(FILE_MAX - b->size);
    assert_int_equal(deflate(&z, Z_FINISH), Z_STREAM_END);
    b->size = FILE_MAX - z.avail_out;
    deflateEnd(&z);
}

/* Stores the `size` low bytes of v in little- or big-endian order, whatever the byte order of
 * the machine. */
static inline void store(unsigned char *p, size_t size, int big, uint64_t v)
{
    for (size_t i = 0; i < size; i++) p[big ? size - 1 - i : i] = (unsigned char)(v >> 8 * i);
}

static inline void store_real(unsigned char *p, size_t size, int big, double v)
{
    const float single = (float)v;
    uint32_t u32;
    uint64_t u64;
    memcpy(&u32, &single, 4);
    memcpy(&u64, &v, 8);
    store(p, size, big, size == 4 ? u32 : u64);
}

/* The ten voxel types and their names in the formats, from the specifications. nifti: datatype
 * code. */
static const struct {
    size_t size;
    int real, nifti;
    const char *nrrd, *meta;
} types[10] = {{1, 0, 2, "uchar", "MET_UCHAR"},
               {1, 0, 256, "int8_t", "MET_CHAR"},
               {2, 0, 512, "ushort", "MET_USHORT"},
               {2, 0, 4, "signed short int", "MET_SHORT"},
               {4, 0, 768, "uint32", "MET_ULONG"},
               {4, 0, 8, "int", "MET_INT"},
               {8, 0, 1280, "uint64_t", "MET_ULONG_LONG"},
               {8, 0, 1024, "long long", "MET_LONG_LONG"},
               {4, 1, 16, "float", "MET_FLOAT"},
               {8, 1, 64, "double", "MET_DOUBLE"}};

static inline void add_voxels(bytes *b, int type, int big, const double *v, size_t n)
{
    for (size_t i = 0; i < n; i++, b->size += types[type].size) {
        assert_true(b->size + 8 <= FILE_MAX);
        if (types[type].real)
            store_real(b->data + b->size, types[type].size, big, v[i]);
        else
            store(b->data + b->size, types[type].size, big, (uint64_t)(int64_t)v[i]);
    }
}

/* Appends a NIfTI header of version 1 or 2, with the four bytes that state no extensions. qform
 * and sform codes are 0, spacings 1, slope 0. */
static inline void add_nifti(bytes *b, int version, int big, int type, const int64_t n[3])
{
    unsigned char *h = b->data;
    const size_t size = version == 2 ? 540 : 348;
    memset(h, 0, size + 4);
    store(h, 4, big, size);
    for (int i = 0; i < 8; i++) {
        const uint64_t dim = i == 0 ? 3 : i <= 3 ? (uint64_t)n[i - 1] : 1;
        if (version == 2)
            store(h + 16 + 8 * i, 8, big, dim);
        else
            store(h + 40 + 2 * i, 2, big, dim);
        store_real(version == 2 ? h + 104 + 8 * i : h + 76 + 4 * i, version == 2 ? 8 : 4, big, 1);
    }
    store(h + (version == 2 ? 12 : 70), 2, big, (uint64_t)types[type].nifti);
    if (version == 2) {
        memcpy(h + 4, "n+2\0\r\n\032\n", 8);
        store(h + 168, 8, big, 544);
    } else {
        memcpy(h + 344, "n+1", 4);
        store_real(h + 108, 4, big, 352);
    }
    b->size = size + 4;
}

static inline void assert_text(const char *text, const char *part)
{
    if (!strstr(text, part)) fail_msg("'%s' is not in '%s'", part, text);
}

/* Asserts the LPS position (x, y, z) of voxel (i, j, k). */
static inline void assert_at(const sdm_volume *v, double i, double j, double k, double x, double y,
                             double z, double tolerance)
{
    const double index[3] = {i, j, k}, want[3] = {x, y, z};
    double is[3];
    sdm_grid_world(&v->grid, index, is);
    for (int a = 0; a < 3; a++)
        if (!(is[a] - want[a] <= tolerance && want[a] - is[a] <= tolerance))
            fail_msg("voxel (%g, %g, %g) is at (%.9g, %.9g, %.9g), wanted (%g, %g, %g)", i, j, k,
                     is[0], is[1], is[2], x, y, z);
}

static inline void assert_read(const char *path, sdm_volume *v)
{
    sdm_error err = {0};
    if (sdm_volume_read(path, v, &err)) fail_msg("%s", err.text);
}

/* Asserts that reading gives this status and a message with `part` in it, and leaves the volume
 * empty. */
static inline void assert_refused(const char *path, sdm_status status, const char *part)
{
    sdm_volume v = {0};
    sdm_error err = {0};
    const sdm_status s = sdm_volume_read(path, &v, &err);
    if (s != status || !strstr(err.text, part))
        fail_msg("wanted status %d and '%s', got %d and '%s'", (int)status, part, (int)s,
                 s ? err.text : "");
    assert_true(v.values == NULL && v.segments == NULL && v.grid.n[0] == 0);
}

#endif
