/* Overlap tests of eight axis-aligned boxes against one other box, with SSE2 where available. */
#pragma once

#include <stddef.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

/* Eight boxes, one per lane: lo[axis][lane], hi[axis][lane]. */
typedef struct sdm_box8 {
    _Alignas(32) float lo[3][8], hi[3][8];
} sdm_box8;

/* Bit mask of the lanes of a whose box overlaps or touches the box in lane k of b. */
static inline unsigned box8_overlap(const sdm_box8 *a, const sdm_box8 *b, size_t k)
{
#if defined(__SSE2__)
    __m128 apart = _mm_setzero_ps(), apart_high = _mm_setzero_ps();
    for (int i = 0; i < 3; i++) {
        const __m128 lo = _mm_set1_ps(b->lo[i][k]), hi = _mm_set1_ps(b->hi[i][k]);
        apart = _mm_or_ps(apart, _mm_cmplt_ps(hi, _mm_load_ps(a->lo[i])));
        apart = _mm_or_ps(apart, _mm_cmpgt_ps(lo, _mm_load_ps(a->hi[i])));
        apart_high = _mm_or_ps(apart_high, _mm_cmplt_ps(hi, _mm_load_ps(a->lo[i] + 4)));
        apart_high = _mm_or_ps(apart_high, _mm_cmpgt_ps(lo, _mm_load_ps(a->hi[i] + 4)));
    }
    return 255u & ~(unsigned)(_mm_movemask_ps(apart) | _mm_movemask_ps(apart_high) << 4);
#else
    unsigned mask = 0;
    for (unsigned l = 0; l < 8; l++) {
        int apart = 0;
        for (int i = 0; i < 3; i++)
            apart |= (a->lo[i][l] > b->hi[i][k]) | (b->lo[i][k] > a->hi[i][l]);
        mask |= (unsigned)!apart << l;
    }
    return mask;
#endif
}
