/* Vector types, loads and loop pragmas for kernels that are compiled once for each instruction set.
   Before inclusion, define VW: the number of floats in a register of the instruction set. A source
   with a faster horizontal sum defines SUM_LANES(v) too, one with a fused multiply-add
   FMA(a, b, c) = a * b + c in one rounding. */
#pragma once

#include <stdint.h>

/* vec: VW floats; vec_u: the same for unaligned addresses; veci, vecu: VW signed or unsigned
   integers of 32 bits. */
typedef float vec __attribute__((vector_size(4 * VW)));
typedef float vec_u __attribute__((vector_size(4 * VW), aligned(4)));
typedef int32_t veci __attribute__((vector_size(4 * VW)));
typedef uint32_t vecu __attribute__((vector_size(4 * VW)));

/* UNROLL(n) before a loop merges n iterations into one. EACH(i, n) is a loop over i = 0 .. n - 1
   that the compiler unrolls completely and early, so that arrays of accumulators stay in
   registers. */
#define PRAGMA(text) _Pragma(#text)
#if defined(__clang__)
#define UNROLL(n) PRAGMA(clang loop unroll_count(n))
#define EACH(i, n) _Pragma("clang loop unroll(full)") for (int i = 0; i < (n); i++)
#else
#define UNROLL(n) PRAGMA(GCC unroll n)
#define EACH(i, n) _Pragma("GCC unroll 8") for (int i = 0; i < (n); i++)
#endif

static inline vec load(const float *p) { return *(const vec_u *)p; }
static inline void store(float *p, vec v) { *(vec_u *)p = v; }
static inline vec splat(float v) { return v - (vec){0}; }

#ifndef FMA
#define FMA(a, b, c) ((a) * (b) + (c))
#endif

/* Sum of the elements of v. */
#ifndef SUM_LANES
static inline float sum_lanes(vec v)
{
    float each[VW], total = 0;
    store(each, v);
    for (int j = 0; j < VW; j++) total += each[j];
    return total;
}
#define SUM_LANES(v) sum_lanes(v)
#endif
