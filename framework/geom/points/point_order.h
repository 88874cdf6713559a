/* Order of points along a space-filling curve, so that consecutive points lie near each other. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* A point's position along the curve, and its index. */
typedef struct sdm_point_key {
    uint32_t place, index;
} sdm_point_key;

/* Bits of a coordinate on the curve. */
#define SDM_CURVE_BITS 10

/* Sets key[i] for the points x[i][3], begin <= i < end, not sorted. scale[a]: 2^SDM_CURVE_BITS over
   the length of the box, which begins at lo. The variants give the same bits. */
typedef void sdm_point_keys(const double *x, size_t begin, size_t end, const double lo[3],
                            const double scale[3], sdm_point_key *key);
sdm_point_keys sdm_point_keys_generic;
#if defined(__x86_64__) && defined(__GNUC__)
sdm_point_keys sdm_point_keys_avx2;
#endif

/* Sorts the points x[n][3], n <= UINT32_MAX, along a Hilbert curve of 2^10 cells per axis (Hilbert
   1891; computed as by Skilling 2004) over the box lo[3] ... hi[3]. Points outside of the box count
   as the nearest points of the box. key[n] = the sorted points; points of one cell are in the order
   of their indices. scratch[n]: any content. keys: a variant for
   this processor. The order does not depend on n_threads. */
void sdm_point_order(const double *x, size_t n, const double lo[3], const double hi[3],
                     sdm_point_keys *keys, int n_threads, sdm_point_key *key,
                     sdm_point_key *scratch);
