/* Two doubles as one compiler vector (v2d): one register of SSE2 or NEON. Every x86-64 or ARM64
   processor has these, so code with v2d need not choose the instruction set at run time. */
#pragma once

#include <math.h>
#include <stdint.h>
#include <string.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#elif defined(__aarch64__)
#include <arm_neon.h>
#endif

typedef double v2d __attribute__((vector_size(16)));

/* Always inlined: a call would pass vectors through memory. */
#define SDM_INLINE static inline __attribute__((always_inline))

SDM_INLINE v2d d2_all(double x) { return (v2d){x, x}; }
SDM_INLINE v2d d2_load(const double *p)
{
    v2d x;
    memcpy(&x, p, sizeof x);
    return x;
}
SDM_INLINE void d2_store(double *p, v2d a) { memcpy(p, &a, sizeof a); }

#if defined(__SSE2__)
/* a < b ? a : b (d2_lesser) and a > b ? a : b (d2_greater) in each lane; b where one is NaN. */
SDM_INLINE v2d d2_lesser(v2d a, v2d b) { return (v2d)_mm_min_pd((__m128d)a, (__m128d)b); }
SDM_INLINE v2d d2_greater(v2d a, v2d b) { return (v2d)_mm_max_pd((__m128d)a, (__m128d)b); }
SDM_INLINE v2d d2_sqrt(v2d a) { return (v2d)_mm_sqrt_pd((__m128d)a); }
/* d2_firsts() = (a[0], b[0]); d2_seconds() = (a[1], b[1]) */
SDM_INLINE v2d d2_firsts(v2d a, v2d b) { return (v2d)_mm_unpacklo_pd((__m128d)a, (__m128d)b); }
SDM_INLINE v2d d2_seconds(v2d a, v2d b) { return (v2d)_mm_unpackhi_pd((__m128d)a, (__m128d)b); }
/* d2_store_f() rounds to two floats and stores them to p[2]; d2_rounded() rounds to float and
   converts back to double. */
SDM_INLINE void d2_store_f(float *p, v2d a)
{
    _mm_storel_pi((__m64 *)(void *)p, _mm_cvtpd_ps((__m128d)a));
}
SDM_INLINE v2d d2_rounded(v2d a) { return (v2d)_mm_cvtps_pd(_mm_cvtpd_ps((__m128d)a)); }
#else
SDM_INLINE v2d d2_lesser(v2d a, v2d b)
{
    return (v2d){a[0] < b[0] ? a[0] : b[0], a[1] < b[1] ? a[1] : b[1]};
}
SDM_INLINE v2d d2_greater(v2d a, v2d b)
{
    return (v2d){a[0] > b[0] ? a[0] : b[0], a[1] > b[1] ? a[1] : b[1]};
}
#if defined(__aarch64__)
SDM_INLINE v2d d2_sqrt(v2d a) { return (v2d)vsqrtq_f64((float64x2_t)a); }
#else
SDM_INLINE v2d d2_sqrt(v2d a) { return (v2d){sqrt(a[0]), sqrt(a[1])}; }
#endif
SDM_INLINE v2d d2_firsts(v2d a, v2d b) { return (v2d){a[0], b[0]}; }
SDM_INLINE v2d d2_seconds(v2d a, v2d b) { return (v2d){a[1], b[1]}; }
SDM_INLINE void d2_store_f(float *p, v2d a)
{
    p[0] = (float)a[0];
    p[1] = (float)a[1];
}
SDM_INLINE v2d d2_rounded(v2d a) { return (v2d){(double)(float)a[0], (double)(float)a[1]}; }
#endif
