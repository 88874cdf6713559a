/* Lists made from bit masks without branches, and references to lanes. Part of map.inc. */
#pragma once

#include <assert.h>

#include "grid_scratch.h"
#include "simd/lanes.h"

/* lane_item() and lane_of(): the item (< n) and the lane of a lane reference 8 * item + lane. */
static inline size_t lane_item(size_t ref, size_t n)
{
    (void)n; // unused without assertions
    assert(ref / 8 < n);
    return ref / 8;
}
static inline size_t lane_of(size_t ref) { return ref % 8; }

/* Appends a reference to lane i of `item` for each bit i of mask: writes to list[n ...] (eight
   elements, whatever the mask) and returns the new length. `room`: length of the array. */
static inline size_t lanes_append(const sdm_grid_job *job, uint16_t *list, size_t n, size_t room,
                                  size_t item, unsigned mask)
{
    (void)room; // unused without assertions
    assert(n + 8 <= room && 8 * item + 7 <= UINT16_MAX && mask < 256);
    const uint16_t b = (uint16_t)(8 * item);
    v8u16 lanes;
    memcpy(&lanes, job->lanes_of[mask], sizeof lanes);
    lanes += (v8u16){b, b, b, b, b, b, b, b};
    memcpy(&list[n], &lanes, sizeof lanes);
    return n + (unsigned)__builtin_popcount(mask);
}

/* Transposes a matrix of 8 x 8 bits: swaps bit j of byte i with bit i of byte j (Warren, Hacker's
   Delight, 2013). */
static inline uint64_t bits_transpose(uint64_t x)
{
    uint64_t t = (x ^ (x >> 7)) & 0x00aa00aa00aa00aau;
    x ^= t ^ (t << 7);
    t = (x ^ (x >> 14)) & 0x0000cccc0000ccccu;
    x ^= t ^ (t << 14);
    t = (x ^ (x >> 28)) & 0x00000000f0f0f0f0u;
    return x ^ t ^ (t << 28);
}

/* Distributes n clusters to the lists of eight blocks: block k gets node[i] where bit k of
   blocks[i] is set, in order. Sets blocks[n ...] to 0 up to the next multiple of eight. Free of
   branches, because the masks are unpredictable. */
static inline void clusters_distribute(const sdm_grid_job *job, uint8_t *blocks,
                                       const uint32_t *node, size_t n, sdm_cluster_list out[8])
{
    for (size_t i = n; i % 8; i++) blocks[i] = 0;
    for (int k = 0; k < 8; k++) out[k].n = 0;
    for (size_t i = 0; i < n; i += 8) {
        // byte k of bits: which of the eight clusters from i on go to block k
        uint64_t bits = 0;
        for (int j = 0; j < 8; j++) bits |= (uint64_t)blocks[i + (size_t)j] << 8 * j;
        bits = bits_transpose(bits);
        const v8i nodes = v8_load_i(&node[i]);
        for (int k = 0; k < 8; k++) {
            const unsigned mask = bits >> 8 * k & 0xff;
            v8_permute(&out[k].list[out[k].n], nodes, job->lanes_of[mask]);
            out[k].n += (unsigned)__builtin_popcount(mask);
        }
    }
}
