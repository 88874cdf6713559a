/* Kernels for AVX-512; kernels_avx512vnni.c includes this file. */
#include <immintrin.h>
#include <stdint.h>

#ifndef TABLE
#define TABLE sdm_kernels_avx512
#define ISA "avx512"
#endif
#define VW 16
#define MR 12
#define LOAD_HALF
static inline __m512 load_half(const uint16_t *p)
{
    return _mm512_cvtph_ps(_mm256_loadu_si256((const __m256i *)(const void *)p));
}
#define LOAD_PAIRS(p)                                                                              \
    ((veci)_mm512_cvtepi8_epi16(_mm256_loadu_si256((const __m256i *)(const void *)(p))))
#define MADD(a, b) ((veci)_mm512_madd_epi16((__m512i)(a), (__m512i)(b)))
#define PREFETCH_BYTES 4096
#define ROUND_TO_SHORTS(v) _mm512_cvtepi32_epi16(_mm512_cvtps_epi32(v))
#define SUM_LANES(v) _mm512_reduce_add_ps(v)
#define MIN_VEC(a, b) _mm512_min_ps(a, b)
#define MAX_VEC(a, b) _mm512_max_ps(a, b)
#define FMA(a, b, c) _mm512_fmadd_ps(a, b, c)
#define STREAM(p, v) _mm512_stream_ps(p, v)
#include "kernels_simd.h"
