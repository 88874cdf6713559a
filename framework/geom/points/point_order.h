/* Order of points along a space-filling curve, so that consecutive points lie near each other. */
#pragma once

#include <stddef.h>
#include <stdint.h>

/* A point's position along the curve, and its index. */
typedef struct sdm_point_key {
    uint32_t place, index;
} sdm_point_key;

/* Sorts the points x[n][3], n <= UINT32_MAX, along a Hilbert curve of 2^10 cells per axis (Hilbert
   1891; computed as by Skilling 2004) over the box lo[3] ... hi[3]. Points outside of the box count
   as the nearest points of the box. key[n] = the sorted points; points of one cell are in the order
   of their indices. scratch[n]: any content. The order does not depend on n_threads. */
void sdm_point_order(const double *x, size_t n, const double lo[3], const double hi[3],
                     int n_threads, sdm_point_key *key, sdm_point_key *scratch);
