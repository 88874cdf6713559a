/* Four boxes or four triangles at once: which overlap, which share a vertex. Masks have bit k for lane k. */
#ifndef SDM_GEOM_PAIR_KERNEL_H
#define SDM_GEOM_PAIR_KERNEL_H

#include <stdint.h>
#if defined(__SSE2__)
#include <emmintrin.h>
#endif

typedef struct sdm_box4 {
    float lo[3][4], hi[3][4];
} sdm_box4;

#if defined(__SSE2__)

/* Lanes of a that do not lie apart from the same lanes of b. */
static inline int box4_overlap(const sdm_box4 *a, const sdm_box4 *b)
{
    __m128 apart = _mm_setzero_ps();
    for (int i = 0; i < 3; i++) {
        apart = _mm_or_ps(apart, _mm_cmpgt_ps(_mm_load_ps(a->lo[i]), _mm_load_ps(b->hi[i])));
        apart = _mm_or_ps(apart, _mm_cmpgt_ps(_mm_load_ps(b->lo[i]), _mm_load_ps(a->hi[i])));
    }
    return 15 & ~_mm_movemask_ps(apart);
}

/* Lanes of b that overlap lane k of a. */
static inline int box4_overlap_one(const sdm_box4 *a, int k, const sdm_box4 *b)
{
    __m128 apart = _mm_setzero_ps();
    for (int i = 0; i < 3; i++) {
        apart = _mm_or_ps(apart, _mm_cmpgt_ps(_mm_set1_ps(a->lo[i][k]), _mm_load_ps(b->hi[i])));
        apart = _mm_or_ps(apart, _mm_cmpgt_ps(_mm_load_ps(b->lo[i]), _mm_set1_ps(a->hi[i][k])));
    }
    return 15 & ~_mm_movemask_ps(apart);
}

/* Lanes of the triangles b that have a vertex of the triangle in lane k of a. */
static inline int vertex4_shared_one(const uint32_t a[3][4], int k, const uint32_t b[3][4])
{
    __m128i shared = _mm_setzero_si128();
    for (int i = 0; i < 3; i++) {
        const __m128i v = _mm_set1_epi32((int)a[i][k]);
        for (int j = 0; j < 3; j++)
            shared = _mm_or_si128(shared, _mm_cmpeq_epi32(v, _mm_load_si128((const __m128i *)(const void *)b[j])));
    }
    return _mm_movemask_ps(_mm_castsi128_ps(shared));
}

#else

static inline int box4_overlap_lane(const sdm_box4 *a, int k, const sdm_box4 *b, int l)
{
    int apart = 0;
    for (int i = 0; i < 3; i++) apart |= (a->lo[i][k] > b->hi[i][l]) | (b->lo[i][l] > a->hi[i][k]);
    return !apart;
}

static inline int box4_overlap(const sdm_box4 *a, const sdm_box4 *b)
{
    int mask = 0;
    for (int l = 0; l < 4; l++) mask |= box4_overlap_lane(a, l, b, l) << l;
    return mask;
}

static inline int box4_overlap_one(const sdm_box4 *a, int k, const sdm_box4 *b)
{
    int mask = 0;
    for (int l = 0; l < 4; l++) mask |= box4_overlap_lane(a, k, b, l) << l;
    return mask;
}

static inline int vertex4_shared_one(const uint32_t a[3][4], int k, const uint32_t b[3][4])
{
    int mask = 0;
    for (int l = 0; l < 4; l++)
        for (int i = 0; i < 3; i++) mask |= ((a[i][k] == b[0][l]) | (a[i][k] == b[1][l]) | (a[i][k] == b[2][l])) << l;
    return mask;
}

#endif
#endif
