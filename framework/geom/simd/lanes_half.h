/* The types and functions of lanes.h for processors without AVX2: each value is a pair of SSE2 or
   NEON registers, elsewhere a pair of compiler vectors of 16 bytes. Part of lanes.h, which
   documents the functions. A single vector type of 32 bytes would be slow, because compilers
   compare and select its elements one by one. */
#pragma once

#if defined(__SSE2__)
#include <emmintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

typedef float v4f __attribute__((vector_size(16)));
typedef int32_t v4i __attribute__((vector_size(16)));
typedef double v2d __attribute__((vector_size(16)));
typedef int64_t v2l __attribute__((vector_size(16)));

typedef struct v8f {
    v4f low, high;
} v8f;
typedef struct v8i {
    v4i low, high;
} v8i;
typedef struct v4d {
    v2d low, high;
} v4d;

/* x where m is all ones, y where m is 0 */
static inline v4f v4f_select(v4i m, v4f x, v4f y) { return (v4f)((m & (v4i)x) | (~m & (v4i)y)); }

#if defined(__SSE2__)
static inline v4f v4f_max(v4f a, v4f b) { return (v4f)_mm_max_ps((__m128)a, (__m128)b); }
static inline v4f v4f_min(v4f a, v4f b) { return (v4f)_mm_min_ps((__m128)a, (__m128)b); }
static inline v4f v4f_sqrt(v4f a) { return (v4f)_mm_sqrt_ps((__m128)a); }
static inline v4f v4f_rsqrt(v4f a) { return (v4f)_mm_rsqrt_ps((__m128)a); }
static inline int v4i_bits(v4i m) { return _mm_movemask_ps((__m128)m); }
static inline v4f v4f_fma(v4f a, v4f b, v4f c) { return a * b + c; }
#elif defined(__aarch64__)
static inline v4f v4f_max(v4f a, v4f b) { return (v4f)vmaxnmq_f32((float32x4_t)a, (float32x4_t)b); }
static inline v4f v4f_min(v4f a, v4f b) { return (v4f)vminnmq_f32((float32x4_t)a, (float32x4_t)b); }
static inline v4f v4f_sqrt(v4f a) { return (v4f)vsqrtq_f32((float32x4_t)a); }
static inline v4f v4f_rsqrt(v4f a)
{
    const float32x4_t x = (float32x4_t)a, r = vrsqrteq_f32(x); // error 2^-8, then one Newton step
    return (v4f)vmulq_f32(r, vrsqrtsq_f32(vmulq_f32(x, r), r));
}
static inline int v4i_bits(v4i m)
{
    const uint32x4_t bit = {1, 2, 4, 8};
    return (int)vaddvq_u32(vandq_u32((uint32x4_t)m, bit));
}
static inline v4f v4f_fma(v4f a, v4f b, v4f c)
{
    return (v4f)vfmaq_f32((float32x4_t)c, (float32x4_t)a, (float32x4_t)b);
}
#else
static inline v4f v4f_max(v4f a, v4f b) { return v4f_select(a > b, a, b); }
static inline v4f v4f_min(v4f a, v4f b) { return v4f_select(a < b, a, b); }
static inline v4f v4f_sqrt(v4f a)
{
    return (v4f){sqrtf(a[0]), sqrtf(a[1]), sqrtf(a[2]), sqrtf(a[3])};
}
static inline v4f v4f_rsqrt(v4f a) { return 1 / v4f_sqrt(a); }
static inline int v4i_bits(v4i m) { return (m[0] & 1) | (m[1] & 2) | (m[2] & 4) | (m[3] & 8); }
static inline v4f v4f_fma(v4f a, v4f b, v4f c) { return a * b + c; }
#endif

/* Memory is accessed as v4f, which may alias floats; the struct v8f may not. For the same reason
   doubles are accessed as v2d, not v4d, below. */
static inline v8f v8_load(const float *p)
{
    const v4f *v = (const v4f *)(const void *)p;
    return (v8f){v[0], v[1]};
}
static inline void v8_store(float *p, v8f x)
{
    v4f *v = (v4f *)(void *)p;
    v[0] = x.low, v[1] = x.high;
}
static inline v8f v8_all(float x) { return (v8f){{x, x, x, x}, {x, x, x, x}}; }
static inline v8f v8_add(v8f a, v8f b) { return (v8f){a.low + b.low, a.high + b.high}; }
static inline v8f v8_sub(v8f a, v8f b) { return (v8f){a.low - b.low, a.high - b.high}; }
static inline v8f v8_mul(v8f a, v8f b) { return (v8f){a.low * b.low, a.high * b.high}; }
static inline v8f v8_div(v8f a, v8f b) { return (v8f){a.low / b.low, a.high / b.high}; }
static inline v8f v8_fma(v8f a, v8f b, v8f c)
{
    return (v8f){v4f_fma(a.low, b.low, c.low), v4f_fma(a.high, b.high, c.high)};
}
static inline v8f v8_max(v8f a, v8f b)
{
    return (v8f){v4f_max(a.low, b.low), v4f_max(a.high, b.high)};
}
static inline v8f v8_min(v8f a, v8f b)
{
    return (v8f){v4f_min(a.low, b.low), v4f_min(a.high, b.high)};
}
static inline v8f v8_abs(v8f a)
{
    return (v8f){(v4f)((v4i)a.low & INT32_MAX), (v4f)((v4i)a.high & INT32_MAX)};
}
static inline v8f v8_sqrt(v8f a) { return (v8f){v4f_sqrt(a.low), v4f_sqrt(a.high)}; }
static inline v8f v8_rsqrt(v8f a) { return (v8f){v4f_rsqrt(a.low), v4f_rsqrt(a.high)}; }
static inline v8f v8_if_negative(v8f m, v8f x, v8f y)
{
    return (v8f){v4f_select((v4i)m.low >> 31, x.low, y.low),
                 v4f_select((v4i)m.high >> 31, x.high, y.high)};
}
static inline int v8_greater(v8f a, v8f b)
{
    return v4i_bits(a.low > b.low) | v4i_bits(a.high > b.high) << 4;
}

static inline float v8_highest(v8f a)
{
    const v4f x = v4f_max(a.low, a.high);
    const float p = x[0] > x[1] ? x[0] : x[1], q = x[2] > x[3] ? x[2] : x[3];
    return p > q ? p : q;
}

static inline v8i v8_load_i(const uint32_t *p)
{
    v8i x;
    memcpy(&x, p, sizeof x);
    return x;
}
static inline void v8_store_i(uint32_t *p, v8i x) { memcpy(p, &x, sizeof x); }
static inline v8i v8_all_i(int32_t x) { return (v8i){{x, x, x, x}, {x, x, x, x}}; }
static inline v8i v8_if_less(v8f a, v8f b, v8i x, v8i y)
{
    return (v8i){(v4i)v4f_select(a.low < b.low, (v4f)x.low, (v4f)y.low),
                 (v4i)v4f_select(a.high < b.high, (v4f)x.high, (v4f)y.high)};
}
static inline bool v8_uniform(v8i a)
{
    const int32_t x = a.low[0];
    const v4i first = {x, x, x, x};
    return v4i_bits((v4i)(a.low == first) & (v4i)(a.high == first)) == 0xf;
}
static inline void v8_permute(uint32_t *out, v8i a, const uint16_t *order)
{
    uint32_t from[8];
    v8_store_i(from, a);
    for (int i = 0; i < 8; i++) out[i] = from[order[i]];
}

static inline v4d v4_all(double x) { return (v4d){{x, x}, {x, x}}; }
static inline v4d v4_load(const double *p)
{
    const v2d *v = (const v2d *)(const void *)p;
    return (v4d){v[0], v[1]};
}
static inline void v4_store(double *p, v4d x)
{
    v2d *v = (v2d *)(void *)p;
    v[0] = x.low, v[1] = x.high;
}
static inline v4d v4_add(v4d a, v4d b) { return (v4d){a.low + b.low, a.high + b.high}; }
static inline v4d v4_sub(v4d a, v4d b) { return (v4d){a.low - b.low, a.high - b.high}; }
static inline v4d v4_mul(v4d a, v4d b) { return (v4d){a.low * b.low, a.high * b.high}; }
static inline v2d v2d_sqrt(v2d a) { return (v2d){sqrt(a[0]), sqrt(a[1])}; }
static inline v4d v4_sqrt(v4d a) { return (v4d){v2d_sqrt(a.low), v2d_sqrt(a.high)}; }
static inline v4d v4_abs(v4d a)
{
    return (v4d){(v2d)((v2l)a.low & INT64_MAX), (v2d)((v2l)a.high & INT64_MAX)};
}
static inline v2d v2d_if_negative(v2d m, v2d x, v2d y)
{
    const v2l set = m < 0; // m is never -0 or NaN, see v4_if_negative()
    return (v2d)((set & (v2l)x) | (~set & (v2l)y));
}
static inline v4d v4_if_negative(v4d m, v4d x, v4d y)
{
    return (v4d){v2d_if_negative(m.low, x.low, y.low), v2d_if_negative(m.high, x.high, y.high)};
}
static inline v8f v8_of_doubles(v4d a, v4d b)
{
    return (v8f){{(float)a.low[0], (float)a.low[1], (float)a.high[0], (float)a.high[1]},
                 {(float)b.low[0], (float)b.low[1], (float)b.high[0], (float)b.high[1]}};
}
static inline void v4_transpose(v4d r[4])
{
    const v4d a = r[0], b = r[1], c = r[2], d = r[3];
    r[0] = (v4d){{a.low[0], b.low[0]}, {c.low[0], d.low[0]}};
    r[1] = (v4d){{a.low[1], b.low[1]}, {c.low[1], d.low[1]}};
    r[2] = (v4d){{a.high[0], b.high[0]}, {c.high[0], d.high[0]}};
    r[3] = (v4d){{a.high[1], b.high[1]}, {c.high[1], d.high[1]}};
}
