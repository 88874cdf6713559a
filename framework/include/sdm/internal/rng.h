/* Counter-based random numbers: each is a pure function of (seed, stream, index), so results depend
 * neither on the order of calls nor on threads. Philox4x32-10 (Salmon et al., "Parallel random
 * numbers: as easy as 1, 2, 3", 2011). */
#pragma once

#include <stdint.h>

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* out[4] = 128 random bits: Philox of the counter (index, stream) with the key `seed`. [any
 * thread] */
void sdm_rng_block(uint64_t seed, uint64_t stream, uint64_t index, uint32_t out[4]);

/* Uniform in [0, 1) with 53 random bits. [any thread] */
double sdm_rng_uniform(uint64_t seed, uint64_t stream, uint64_t index);

/* Standard normal distribution (Box and Muller 1958). [any thread] */
double sdm_rng_normal(uint64_t seed, uint64_t stream, uint64_t index);

/* Uniform integer in 0 .. n - 1, n > 0. Relative deviation from uniform: below n 2^-32 for n < 2^32
 * (multiply and shift), else below n 2^-64 (modulo). [any thread] */
uint64_t sdm_rng_below(uint64_t seed, uint64_t stream, uint64_t index, uint64_t n);

/* Finaliser of SplitMix64 (Steele, Lea and Flood, "Fast splittable pseudorandom number generators",
 * 2014): mixes every bit of x into all bits of the result; for hash tables. [any thread] */
static inline uint64_t sdm_mix64(uint64_t x)
{
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

#ifdef __cplusplus
}
#endif
