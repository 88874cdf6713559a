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
#define LOAD_PAIRS(p)                                                                              \
    ((veci)_mm256_cvtepi8_epi16(_mm_loadu_si128((const __m128i *)(const void *)(p))))
#define MADD(a, b) ((veci)_mm256_madd_epi16((__m256i)(a), (__m256i)(b)))
#define MAX_VECI(a, b) ((veci)_mm256_max_epi32((__m256i)(a), (__m256i)(b)))
#define ROUND_TO_SHORTS(v) round_to_shorts(v)
static inline __m128i round_to_shorts(__m256 v)
{
    const __m256i i = _mm256_cvtps_epi32(v);
    return _mm_packs_epi32(_mm256_castsi256_si128(i), _mm256_extracti128_si256(i, 1));
}
#define SUM_LANES(v) sum_lanes(v)
static inline float sum_lanes(__m256 v)
{
    __m128 sum = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
    sum = _mm_add_ps(sum, _mm_movehl_ps(sum, sum));
    return _mm_cvtss_f32(_mm_add_ss(sum, _mm_movehdup_ps(sum)));
}
#define MIN_VEC(a, b) _mm256_min_ps(a, b)
#define MAX_VEC(a, b) _mm256_max_ps(a, b)
#define FMA(a, b, c) _mm256_fmadd_ps(a, b, c)
#define STREAM(p, v) _mm256_stream_ps(p, v)
#include "kernels_simd.h"
