/* One line of an exact Euclidean distance transform. */
#ifndef SDM_ENVELOPE_H
#define SDM_ENVELOPE_H

#include <stdint.h>

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* f[i], i < n, becomes the least of f[k] + (spacing (i - k))^2 over all k: the lower envelope of
   parabolas, in linear time (Felzenszwalb and Huttenlocher 2012). f is a squared distance, mm^2
   where spacing is mm: 0 or more, INFINITY where there is nothing; a line of nothing stays as it
   is. scratch: 3 n numbers. Cannot fail. [any thread, on f and scratch of its own] */
void sdm_lower_envelope(double *f, int64_t n, double spacing, double *scratch);

#ifdef __cplusplus
}
#endif
#endif
