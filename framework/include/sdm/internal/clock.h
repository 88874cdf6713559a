/* Monotonic clock for measuring elapsed time. */
#ifndef SDM_CLOCK_H
#define SDM_CLOCK_H

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Time in seconds since an arbitrary start; it never decreases, so only differences are meaningful.
 * [any thread] */
double sdm_clock(void);

#ifdef __cplusplus
}
#endif
#endif
