/* From the parts that things concern to the things that concern each part. Part of the map kernels. */
#ifndef SDM_GEOM_LISTS_KERNEL_H
#define SDM_GEOM_LISTS_KERNEL_H

#include "grid_job.h"
#include "lanes.h"

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

/* Makes lists of one kind: for each i of from .. to and each bit k of hit[i], part k gets what[i], or i where `what` is NULL. from is a
   multiple of eight; hit[] becomes 0 up to the next one. Without branches: who is hit cannot be foreseen. */
static inline void list_hits(const sdm_grid_job *job, uint8_t *hit, const uint32_t *what, size_t from, size_t to,
                             sdm_candidates out[8], int kind)
{
    for (size_t i = to; i % 8; i++) hit[i] = 0;
    for (int k = 0; k < 8; k++) out[k].begin[kind] = out[k].end[kind] = kind ? (out[k].end[kind - 1] + 7) / 8 * 8 : 0;
    for (size_t i = from; i < to; i += 8) {
        uint64_t bits = 0;
        for (int j = 0; j < 8; j++) bits |= (uint64_t)hit[i + (size_t)j] << 8 * j;
        bits = transpose_bits(bits);
        const v8i things = what ? v8_load_i(&what[i]) : v8_from_i((int32_t)i);
        for (int k = 0; k < 8; k++) {
            const unsigned mask = bits >> 8 * k & 0xff;
            v8_permute(&out[k].list[out[k].end[kind]], things, job->lanes_of[mask]);
            out[k].end[kind] += (unsigned)__builtin_popcount(mask);
        }
    }
}

#endif
