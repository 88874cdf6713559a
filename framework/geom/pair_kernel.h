/* Eight boxes of whole numbers at once: which overlap another. Masks have bit k for lane k. */
#ifndef SDM_GEOM_PAIR_KERNEL_H
#define SDM_GEOM_PAIR_KERNEL_H

#include <stdint.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

typedef int16_t sdm_i16x8 __attribute__((vector_size(16)));

/* Eight boxes, or one in all lanes. */
typedef struct sdm_box8 {
    sdm_i16x8 lo[3], hi[3];
} sdm_box8;

static inline sdm_i16x8 i16x8_all(int16_t x) { return (sdm_i16x8){x, x, x, x, x, x, x, x}; }

/* A box and a half-empty register of its bounds: lo in 0 - 2, hi in 4 - 6. */
static inline void box8_all(sdm_i16x8 bounds, sdm_box8 *b)
{
#if defined(__SSE2__)
    const __m128i x = (__m128i)bounds;
#define SDM_ALL_LOW(i) (sdm_i16x8) _mm_shuffle_epi32(_mm_shufflelo_epi16(x, 0x55 * (i)), 0)
#define SDM_ALL_HIGH(i) (sdm_i16x8) _mm_shuffle_epi32(_mm_shufflehi_epi16(x, 0x55 * (i)), 0xaa)
    b->lo[0] = SDM_ALL_LOW(0), b->lo[1] = SDM_ALL_LOW(1), b->lo[2] = SDM_ALL_LOW(2);
    b->hi[0] = SDM_ALL_HIGH(0), b->hi[1] = SDM_ALL_HIGH(1), b->hi[2] = SDM_ALL_HIGH(2);
#undef SDM_ALL_LOW
#undef SDM_ALL_HIGH
#else
    for (int i = 0; i < 3; i++) {
        b->lo[i] = i16x8_all(bounds[i]);
        b->hi[i] = i16x8_all(bounds[4 + i]);
    }
#endif
}

/* Lanes in which a and b do not lie apart. */
static inline unsigned box8_overlap(const sdm_box8 *a, const sdm_box8 *b)
{
    sdm_i16x8 apart = i16x8_all(0);
    for (int i = 0; i < 3; i++) apart |= (sdm_i16x8)(a->lo[i] > b->hi[i]) | (sdm_i16x8)(b->lo[i] > a->hi[i]);
#if defined(__SSE2__)
    return 255u & ~(unsigned)_mm_movemask_epi8(_mm_packs_epi16((__m128i)apart, (__m128i)apart));
#else
    unsigned mask = 0;
    for (unsigned l = 0; l < 8; l++) mask |= (apart[l] ? 0u : 1u) << l;
    return mask;
#endif
}

#endif
