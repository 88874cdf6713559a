/* Kernels for the baseline instruction set: SSE2 on x86-64, NEON on arm64, elsewhere whatever the
   compiler makes of vectors of four floats. */
#define TABLE sdm_kernels_generic
#if defined(__x86_64__)
#define ISA "sse2"
#include <emmintrin.h>
#define STREAM(p, v) _mm_stream_ps(p, v)
#define MADD(a, b) ((veci)_mm_madd_epi16((__m128i)(a), (__m128i)(b)))
#elif defined(__aarch64__)
#define ISA "neon"
#include <arm_neon.h>
#define MADD(a, b)                                                                                 \
    ((veci)vpaddq_s32(vmull_s16(vget_low_s16((int16x8_t)(a)), vget_low_s16((int16x8_t)(b))),       \
                      vmull_high_s16((int16x8_t)(a), (int16x8_t)(b))))
#define FMA(a, b, c) vfmaq_f32(c, a, b)
#define ROUND_TO_SHORTS(v) vqmovn_s32(vcvtnq_s32_f32(v))
#else
#define ISA "generic"
#endif
#define VW 4
#define MR 6
#include "kernels_simd.h"
