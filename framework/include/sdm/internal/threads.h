/* How many threads a call takes, and which of them one is. */
#ifndef SDM_THREADS_H
#define SDM_THREADS_H

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* `wanted` where it is positive, else as many as OpenMP would take, but at most 64 or two for each
   processor, whichever is more: OpenMP ends the program where it cannot start as many. 1 in a build
   without OpenMP. [any thread] */
int sdm_threads(int wanted);

/* Number of the calling thread in its team, 0 for the one that called the library. [any thread] */
int sdm_thread(void);

#ifdef __cplusplus
}
#endif
#endif
