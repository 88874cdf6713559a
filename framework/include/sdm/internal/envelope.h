/* One-dimensional squared distance transform, the building block of exact Euclidean distance
 * transforms. */
#pragma once

#include <stdint.h>

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Replaces f[i], 0 <= i < n, by min over k of f[k] + (spacing (i - k))^2: the lower envelope of
 * parabolas, in linear time (Felzenszwalb and Huttenlocher 2012). f: squared distances >= 0, mm^2
 * for a spacing in mm; INFINITY where no distance is known. If all f[i] are INFINITY, f is
 * unchanged. scratch[3 n]: memory of the caller. [any thread, with its own f and scratch] */
void sdm_lower_envelope(double *f, int64_t n, double spacing, double *scratch);

#ifdef __cplusplus
}
#endif
