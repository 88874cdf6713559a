/* Reads numbers from the bytes of a file in either byte order, and writes them in little endian,
   whatever the byte order of the machine; tests the endings of file names. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include "sdm/internal/file.h"

/* The unsigned number of `size` bytes at p; big: big-endian. */
static inline uint64_t sdm_get_uint(const uint8_t *p, size_t size, bool big)
{
    uint64_t v = 0;
    for (size_t i = 0; i < size; i++) v = v << 8 | p[big ? i : size - 1 - i];
    return v;
}

static inline float sdm_get_f32(const uint8_t *p, bool big)
{
    const uint32_t bits = (uint32_t)sdm_get_uint(p, 4, big);
    float v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

static inline double sdm_get_f64(const uint8_t *p, bool big)
{
    const uint64_t bits = sdm_get_uint(p, 8, big);
    double v;
    memcpy(&v, &bits, sizeof v);
    return v;
}

/* Stores the lowest `size` bytes of v, little endian. */
static inline void sdm_put_uint(uint8_t *p, size_t size, uint64_t v)
{
    for (size_t i = 0; i < size; i++) p[i] = (uint8_t)(v >> 8 * i);
}

static inline void sdm_put_f32(uint8_t *p, float v)
{
    uint32_t bits;
    memcpy(&bits, &v, sizeof bits);
    sdm_put_uint(p, 4, bits);
}

static inline void sdm_put_f64(uint8_t *p, double v)
{
    uint64_t bits;
    memcpy(&bits, &v, sizeof bits);
    sdm_put_uint(p, 8, bits);
}

/* True when `path` ends with `ext` (".ply", in lower case), ignoring the case of `path`, and has
 * more characters before it. */
static inline bool sdm_has_ext(const char *path, const char *ext)
{
    const size_t n = strlen(path), m = strlen(ext);
    if (n <= m) return false;
    for (size_t i = 0; i < m; i++) {
        const char c = path[n - m + i];
        if ((c >= 'A' && c <= 'Z' ? c - 'A' + 'a' : c) != ext[i]) return false;
    }
    return true;
}
