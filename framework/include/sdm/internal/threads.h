/* Number of threads for a parallel section, and number of the calling thread. */
#pragma once

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Number of threads to use: `wanted` if positive, else OpenMP's default; at most max(64, 2 *
 * processors), because OpenMP aborts the program if it cannot start a thread. 1 in a build without
 * OpenMP, and in a child process that was made by fork() after the first call. [any thread] */
int sdm_threads(int wanted);

/* Number of the calling thread in its OpenMP team, from 0; 0 outside of parallel sections. [any
 * thread] */
int sdm_thread(void);

#ifdef __cplusplus
}
#endif
