/* Eight floats or four doubles at once: vector extensions of the compiler, with intrinsics where they say more. */
#ifndef SDM_GEOM_LANES_H
#define SDM_GEOM_LANES_H

#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__AVX2__) && defined(__FMA__)
#include <immintrin.h>
#endif

typedef float v8f __attribute__((vector_size(32)));
typedef int32_t v8i __attribute__((vector_size(32)));
typedef double v4d __attribute__((vector_size(32)));
typedef int64_t v4l __attribute__((vector_size(32)));

static inline v8f v8_load(const float *p) { return *(const v8f *)(const void *)p; }
static inline void v8_store(float *p, v8f x) { *(v8f *)(void *)p = x; }
static inline v8f v8_all(float x) { return (v8f){x, x, x, x, x, x, x, x}; }
static inline v4d v4_all(double x) { return (v4d){x, x, x, x}; }
static inline v4d v4_load(const double *p) { return *(const v4d *)(const void *)p; }

#if defined(__AVX2__) && defined(__FMA__)
static inline v8f v8_max(v8f a, v8f b) { return (v8f)_mm256_max_ps((__m256)a, (__m256)b); }
static inline v8f v8_min(v8f a, v8f b) { return (v8f)_mm256_min_ps((__m256)a, (__m256)b); }
static inline v8f v8_abs(v8f a) { return (v8f)_mm256_andnot_ps(_mm256_set1_ps(-0.0f), (__m256)a); }
static inline v8f v8_sqrt(v8f a) { return (v8f)_mm256_sqrt_ps((__m256)a); }
/* a * b + c */
static inline v8f v8_fma(v8f a, v8f b, v8f c) { return (v8f)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c); }
/* x where the sign of m is set, else y */
static inline v8f v8_signed(v8f m, v8f x, v8f y) { return (v8f)_mm256_blendv_ps((__m256)y, (__m256)x, (__m256)m); }
/* bit i: a[i] > b[i] */
static inline int v8_greater(v8f a, v8f b)
{
    return _mm256_movemask_ps(_mm256_cmp_ps((__m256)a, (__m256)b, _CMP_GT_OQ));
}
static inline v4d v4_max(v4d a, v4d b) { return (v4d)_mm256_max_pd((__m256d)a, (__m256d)b); }
static inline v4d v4_min(v4d a, v4d b) { return (v4d)_mm256_min_pd((__m256d)a, (__m256d)b); }
static inline v4d v4_abs(v4d a) { return (v4d)_mm256_andnot_pd(_mm256_set1_pd(-0.0), (__m256d)a); }
static inline v4d v4_signed(v4d m, v4d x, v4d y) { return (v4d)_mm256_blendv_pd((__m256d)y, (__m256d)x, (__m256d)m); }
#else
static inline v8f v8_select(v8i m, v8f x, v8f y) { return (v8f)((m & (v8i)x) | (~m & (v8i)y)); }
static inline v8f v8_max(v8f a, v8f b) { return v8_select(a > b, a, b); }
static inline v8f v8_min(v8f a, v8f b) { return v8_select(a < b, a, b); }
static inline v8f v8_abs(v8f a) { return (v8f)((v8i)a & INT32_MAX); }
static inline v8f v8_sqrt(v8f a)
{
    for (int i = 0; i < 8; i++) a[i] = sqrtf(a[i]);
    return a;
}
static inline v8f v8_fma(v8f a, v8f b, v8f c) { return a * b + c; }
static inline v8f v8_signed(v8f m, v8f x, v8f y) { return v8_select((v8i)m < 0, x, y); }
static inline int v8_greater(v8f a, v8f b)
{
    const v8i m = a > b;
    int bits = 0;
    for (int i = 0; i < 8; i++) bits |= (m[i] & 1) << i;
    return bits;
}
static inline v4d v4_select(v4l m, v4d x, v4d y) { return (v4d)((m & (v4l)x) | (~m & (v4l)y)); }
static inline v4d v4_max(v4d a, v4d b) { return v4_select(a > b, a, b); }
static inline v4d v4_min(v4d a, v4d b) { return v4_select(a < b, a, b); }
static inline v4d v4_abs(v4d a) { return (v4d)((v4l)a & INT64_MAX); }
static inline v4d v4_signed(v4d m, v4d x, v4d y) { return v4_select((v4l)m < 0, x, y); }
#endif

#endif
