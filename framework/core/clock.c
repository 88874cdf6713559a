/* Clocks of the operating system. */
#include "sdm/internal/clock.h"

#include <time.h>

static double seconds(clockid_t clock)
{
    struct timespec t;
    (void)clock_gettime(clock, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double sdm_clock(void) { return seconds(CLOCK_MONOTONIC); }

double sdm_thread_clock(void) { return seconds(CLOCK_THREAD_CPUTIME_ID); }
