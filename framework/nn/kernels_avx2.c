/* Kernels for AVX2 with FMA and F16C. */
#include <immintrin.h>
#include <stdint.h>

#define TABLE sdm_kernels_avx2
#define ISA "avx2"
#define VW 8
#define MR 6
#define LOAD_HALF
static inline __m256 load_half(const uint16_t *p)
{
    return _mm256_cvtph_ps(_mm_loadu_si128((const __m128i *)(const void *)p));
}
#define LOAD_PAIRS(p) ((veci)_mm256_cvtepi8_epi16(_mm_loadu_si128((const __m128i *)(const void *)(p))))
#define MADD(a, b) ((veci)_mm256_madd_epi16((__m256i)(a), (__m256i)(b)))
#define LARGER(a, b) ((veci)_mm256_max_epi32((__m256i)(a), (__m256i)(b)))
#define STREAM(p, v) _mm256_stream_ps(p, v)
#include "kernels_simd.h"
