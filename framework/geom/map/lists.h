/* Lists of what concerns what, made from masks. Part of the map kernels. */
#ifndef SDM_GEOM_LISTS_KERNEL_H
#define SDM_GEOM_LISTS_KERNEL_H

#include "grid_job.h"
#include "simd/lanes.h"

/* Bit j of byte i and bit i of byte j change places (Warren 2013, transposing a bit matrix). */
static inline uint64_t transpose_bits(uint64_t x)
{
    uint64_t t = (x ^ (x >> 7)) & 0x00aa00aa00aa00aau;
    x ^= t ^ (t << 7);
    t = (x ^ (x >> 14)) & 0x0000cccc0000ccccu;
    x ^= t ^ (t << 14);
    t = (x ^ (x >> 28)) & 0x00000000f0f0f0f0u;
    return x ^ t ^ (t << 28);
}

/* Makes lists: for each i of 0 .. n and each bit k of hit[i], block k gets what[i]; hit[] becomes 0
   up to the next multiple of eight. Without branches: who is hit cannot be foreseen. */
static inline void list_hits(const sdm_grid_job *job, uint8_t *hit, const uint32_t *what, size_t n,
                             sdm_cluster_list out[8])
{
    for (size_t i = n; i % 8; i++) hit[i] = 0;
    for (int k = 0; k < 8; k++) out[k].n = 0;
    for (size_t i = 0; i < n; i += 8) {
        uint64_t bits = 0;
        for (int j = 0; j < 8; j++) bits |= (uint64_t)hit[i + (size_t)j] << 8 * j;
        bits = transpose_bits(bits);
        const v8i things = v8_load_i(&what[i]);
        for (int k = 0; k < 8; k++) {
            const unsigned mask = bits >> 8 * k & 0xff;
            v8_permute(&out[k].list[out[k].n], things, job->lanes_of[mask]);
            out[k].n += (unsigned)__builtin_popcount(mask);
        }
    }
}

/* Appends base + i for each bit i of mask behind list[n]; returns the new n. */
static inline size_t put_lanes(const sdm_grid_job *job, uint16_t *list, size_t n, uint32_t base,
                               unsigned mask)
{
    const uint16_t b = (uint16_t)base;
    v8s lanes;
    memcpy(&lanes, job->lanes_of[mask], sizeof lanes);
    lanes += (v8s){b, b, b, b, b, b, b, b};
    memcpy(&list[n], &lanes, sizeof lanes);
    return n + (unsigned)__builtin_popcount(mask);
}

#endif
