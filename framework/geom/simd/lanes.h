/* SIMD types of eight floats (v8f), eight 32-bit integers (v8i) and four doubles (v4d). Each is one
   register with AVX2; without AVX2 it is two registers of half the size, with the same names and
   functions (lanes_half.h). A lane is one element. v8_load(), v8_store(), v4_load() and v4_store()
   need 32-byte alignment; v8_load_i() and v8_store_i() do not. */
#pragma once

#include <math.h>
#include <stdbool.h>
#include <stdint.h>
#include <string.h>
#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

/* Always inlined: a function with a parameter `kind` (of feature) is compiled anew for each caller
   that passes a constant. */
#define SDM_FOR_KIND static inline __attribute__((always_inline))

typedef uint16_t v8u16 __attribute__((vector_size(16)));

#if defined(__AVX2__) && defined(__FMA__)
typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));
typedef double v4d __attribute__((vector_size(32)));

static inline v8f v8_load(const float *p) { return *(const v8f *)(const void *)p; }
static inline void v8_store(float *p, v8f x) { *(v8f *)(void *)p = x; }
static inline v8f v8_all(float x) { return (v8f)_mm256_set1_ps(x); }
static inline v8f v8_add(v8f a, v8f b) { return a + b; }
static inline v8f v8_sub(v8f a, v8f b) { return a - b; }
static inline v8f v8_mul(v8f a, v8f b) { return a * b; }
static inline v8f v8_div(v8f a, v8f b) { return a / b; }
/* a * b + c */
static inline v8f v8_fma(v8f a, v8f b, v8f c)
{
    return (v8f)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
}
static inline v8f v8_max(v8f a, v8f b) { return (v8f)_mm256_max_ps((__m256)a, (__m256)b); }
static inline v8f v8_min(v8f a, v8f b) { return (v8f)_mm256_min_ps((__m256)a, (__m256)b); }
static inline v8f v8_abs(v8f a) { return (v8f)_mm256_andnot_ps(_mm256_set1_ps(-0.0f), (__m256)a); }
static inline v8f v8_sqrt(v8f a) { return (v8f)_mm256_sqrt_ps((__m256)a); }
/* 1 / sqrt(a), relative error < 4e-4; the bits depend on the processor */
static inline v8f v8_rsqrt(v8f a) { return (v8f)_mm256_rsqrt_ps((__m256)a); }
/* x where the sign bit of m is set (also -0), else y */
static inline v8f v8_if_negative(v8f m, v8f x, v8f y)
{
    return (v8f)_mm256_blendv_ps((__m256)y, (__m256)x, (__m256)m);
}
/* Mask with bit i set where a[i] > b[i]; a NaN compares false. */
static inline int v8_greater(v8f a, v8f b)
{
    return _mm256_movemask_ps(_mm256_cmp_ps((__m256)a, (__m256)b, _CMP_GT_OQ));
}

/* The largest lane; unspecified if a lane is NaN. */
static inline float v8_highest(v8f a)
{
    __m128 x = _mm_max_ps(_mm256_castps256_ps128((__m256)a), _mm256_extractf128_ps((__m256)a, 1));
    x = _mm_max_ps(x, _mm_movehl_ps(x, x));
    return _mm_cvtss_f32(_mm_max_ss(x, _mm_movehdup_ps(x)));
}

static inline v8i v8_load_i(const uint32_t *p)
{
    return (v8i)_mm256_loadu_si256((const __m256i *)(const void *)p);
}
static inline void v8_store_i(uint32_t *p, v8i x)
{
    _mm256_storeu_si256((__m256i *)(void *)p, (__m256i)x);
}
static inline v8i v8_all_i(int32_t x) { return (v8i)_mm256_set1_epi32(x); }
/* x where a < b, else y */
static inline v8i v8_if_less(v8f a, v8f b, v8i x, v8i y)
{
    return (v8i)_mm256_blendv_epi8(
        (__m256i)y, (__m256i)x,
        _mm256_castps_si256(_mm256_cmp_ps((__m256)a, (__m256)b, _CMP_LT_OQ)));
}
/* Are all lanes equal? */
static inline bool v8_uniform(v8i a)
{
    const __m256i first = _mm256_broadcastd_epi32(_mm256_castsi256_si128((__m256i)a));
    return _mm256_movemask_epi8(_mm256_cmpeq_epi32((__m256i)a, first)) == -1;
}
/* out[i] = a[order[i]] for i = 0 to 7; order[] must be aligned to 16 bytes. */
static inline void v8_permute(uint32_t *out, v8i a, const uint16_t *order)
{
    const __m256i which =
        _mm256_cvtepu16_epi32(_mm_load_si128((const __m128i *)(const void *)order));
    _mm256_storeu_si256((__m256i *)(void *)out, _mm256_permutevar8x32_epi32((__m256i)a, which));
}

static inline v4d v4_all(double x) { return (v4d)_mm256_set1_pd(x); }
static inline v4d v4_load(const double *p) { return *(const v4d *)(const void *)p; }
static inline void v4_store(double *p, v4d x) { *(v4d *)(void *)p = x; }
static inline v4d v4_add(v4d a, v4d b) { return a + b; }
static inline v4d v4_sub(v4d a, v4d b) { return a - b; }
static inline v4d v4_mul(v4d a, v4d b) { return a * b; }
static inline v4d v4_sqrt(v4d a) { return (v4d)_mm256_sqrt_pd((__m256d)a); }
static inline v4d v4_abs(v4d a) { return (v4d)_mm256_andnot_pd(_mm256_set1_pd(-0.0), (__m256d)a); }
/* x where m < 0, else y; m must not be -0 or NaN */
static inline v4d v4_if_negative(v4d m, v4d x, v4d y)
{
    return (v4d)_mm256_blendv_pd((__m256d)y, (__m256d)x, (__m256d)m);
}
/* The eight doubles of a and b as floats. */
static inline v8f v8_of_doubles(v4d a, v4d b)
{
    return (v8f)_mm256_set_m128(_mm256_cvtpd_ps((__m256d)b), _mm256_cvtpd_ps((__m256d)a));
}
/* Transposes a matrix of 4 x 4 doubles in place, r[row] with one column in each lane. */
static inline void v4_transpose(v4d r[4])
{
    const __m256d a = _mm256_unpacklo_pd((__m256d)r[0], (__m256d)r[1]);
    const __m256d b = _mm256_unpackhi_pd((__m256d)r[0], (__m256d)r[1]);
    const __m256d c = _mm256_unpacklo_pd((__m256d)r[2], (__m256d)r[3]);
    const __m256d d = _mm256_unpackhi_pd((__m256d)r[2], (__m256d)r[3]);
    r[0] = (v4d)_mm256_permute2f128_pd(a, c, 0x20);
    r[1] = (v4d)_mm256_permute2f128_pd(b, d, 0x20);
    r[2] = (v4d)_mm256_permute2f128_pd(a, c, 0x31);
    r[3] = (v4d)_mm256_permute2f128_pd(b, d, 0x31);
}
#else
#include "lanes_half.h"
#endif

/* Eight points or vectors, one in each lane. */
typedef struct point8 {
    v8f x, y, z;
} point8;

static inline point8 p8_all(float x, float y, float z)
{
    return (point8){v8_all(x), v8_all(y), v8_all(z)};
}
static inline point8 p8_load(const float x[3][8])
{
    return (point8){v8_load(x[0]), v8_load(x[1]), v8_load(x[2])};
}
static inline void p8_store(float x[3][8], point8 p)
{
    v8_store(x[0], p.x);
    v8_store(x[1], p.y);
    v8_store(x[2], p.z);
}
static inline point8 p8_add(point8 a, point8 b)
{
    return (point8){v8_add(a.x, b.x), v8_add(a.y, b.y), v8_add(a.z, b.z)};
}
static inline point8 p8_sub(point8 a, point8 b)
{
    return (point8){v8_sub(a.x, b.x), v8_sub(a.y, b.y), v8_sub(a.z, b.z)};
}
static inline point8 p8_scale(point8 a, v8f t)
{
    return (point8){v8_mul(a.x, t), v8_mul(a.y, t), v8_mul(a.z, t)};
}
/* a . b + c */
static inline v8f p8_linear(point8 a, point8 b, v8f c)
{
    return v8_fma(a.x, b.x, v8_fma(a.y, b.y, v8_fma(a.z, b.z, c)));
}
static inline v8f p8_dot(point8 a, point8 b)
{
    return v8_fma(a.x, b.x, v8_fma(a.y, b.y, v8_mul(a.z, b.z)));
}
