/* The larger and the smaller elements of two vectors, which the compiler's vector types lack.
   Before inclusion, define VW as for kernels_vector.h: 8 for AVX, else 4. */
#pragma once

#include "kernels_vector.h"
#if defined(__x86_64__)
#include <immintrin.h>
#endif

/* MAX_VEC(a, b) = a > b ? a : b and MIN_VEC(a, b) = a < b ? a : b: b if a is not a number. */
#if VW == 8
#define MAX_VEC(a, b) _mm256_max_ps(a, b)
#define MIN_VEC(a, b) _mm256_min_ps(a, b)
#elif defined(__x86_64__)
#define MAX_VEC(a, b) _mm_max_ps(a, b)
#define MIN_VEC(a, b) _mm_min_ps(a, b)
#else
#define MAX_VEC(a, b) select_vec((a) > (b), a, b)
#define MIN_VEC(a, b) select_vec((a) < (b), a, b)
static inline vec select_vec(veci mask, vec a, vec b)
{
    return (vec)(((veci)a & mask) | ((veci)b & ~mask));
}
#endif
