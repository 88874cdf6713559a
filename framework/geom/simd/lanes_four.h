/* Four doubles as one compiler vector (d4): one register of AVX, two of SSE2 or NEON. Unlike v4d of
   lanes.h, it has arithmetic operators and element access, d[i]. */
#pragma once

#include "lanes_two.h"

typedef double d4 __attribute__((vector_size(32)));
typedef int64_t d4_mask __attribute__((vector_size(32)));

SDM_INLINE d4 d4_all(double x) { return (d4){x, x, x, x}; }
SDM_INLINE v2d d4_low(d4 a) { return (v2d){a[0], a[1]}; }
SDM_INLINE v2d d4_high(d4 a) { return (v2d){a[2], a[3]}; }
SDM_INLINE d4 d4_of(v2d low, v2d high) { return (d4){low[0], low[1], high[0], high[1]}; }
/* x where m is all ones, y where m is 0 */
SDM_INLINE d4 d4_select(d4_mask m, d4 x, d4 y)
{
    return (d4)((m & (d4_mask)x) | (~m & (d4_mask)y));
}
/* Is any lane of a comparison true? */
SDM_INLINE int d4_any(d4_mask m) { return (m[0] | m[1] | m[2] | m[3]) != 0; }
SDM_INLINE d4 d4_abs(d4 a) { return (d4)((d4_mask)a & INT64_MAX); }
/* Dot products of four pairs of vectors. */
SDM_INLINE d4 d4_dot(const d4 a[3], const d4 b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}
SDM_INLINE d4 d4_sqrt(d4 a) { return d4_of(d2_sqrt(d4_low(a)), d2_sqrt(d4_high(a))); }
/* Rounds to float and converts back to double. */
SDM_INLINE d4 d4_rounded(d4 a) { return d4_of(d2_rounded(d4_low(a)), d2_rounded(d4_high(a))); }
/* Rounds to four floats and stores them to p[4]. */
SDM_INLINE void d4_store_f(float *p, d4 a)
{
    d2_store_f(p, d4_low(a));
    d2_store_f(p + 2, d4_high(a));
}

/* to[lane][i] = row[i][lane] for i < n, n even. */
SDM_INLINE void d4_store_rows(const d4 *row, int n, double *const to[4])
{
    for (int i = 0; i < n; i += 2) {
        const v2d a = d4_low(row[i]), b = d4_low(row[i + 1]), c = d4_high(row[i]),
                  d = d4_high(row[i + 1]);
        d2_store(to[0] + i, d2_firsts(a, b));
        d2_store(to[1] + i, d2_seconds(a, b));
        d2_store(to[2] + i, d2_firsts(c, d));
        d2_store(to[3] + i, d2_seconds(c, d));
    }
}
