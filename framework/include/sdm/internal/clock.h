/* Clocks for measuring elapsed time and processor time. */
#pragma once

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Time in seconds since an arbitrary start; it never decreases, so only differences are meaningful.
 * [any thread] */
double sdm_clock(void);

/* Processor time of the calling thread in seconds; only differences are meaningful. [any thread] */
double sdm_thread_clock(void);

#ifdef __cplusplus
}
#endif
