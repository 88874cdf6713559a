/* Time that has gone by. */
#ifndef SDM_CLOCK_H
#define SDM_CLOCK_H

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Seconds of a clock that never goes back; differences alone mean something. [any thread] */
double sdm_clock(void);

#ifdef __cplusplus
}
#endif
#endif
