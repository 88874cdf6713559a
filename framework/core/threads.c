/* Number of threads, and number of the calling thread. */
#include "sdm/internal/threads.h"

#include <stdbool.h>

#ifdef _OPENMP
#include <omp.h>
#include <pthread.h>
#endif

/* At least this many threads are allowed, because tests use more threads than a small machine has
 * processors. */
#define LIMIT_MIN 64

#ifdef _OPENMP
/* The threads of the team of gcc's OpenMP do not exist in a child made by fork(), where it would
 * wait for them for ever: a child has one thread. */
static bool forked;
static void note_fork(void) { forked = true; }
static void watch_forks(void) { pthread_atfork(NULL, NULL, note_fork); }
#endif

int sdm_threads(int wanted)
{
#ifdef _OPENMP
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, watch_forks);
    if (forked) return 1;
    const int n = wanted > 0 ? wanted : omp_get_max_threads(), twice = 2 * omp_get_num_procs();
    const int most = twice > LIMIT_MIN ? twice : LIMIT_MIN;
    return n < most ? n : most;
#else
    (void)wanted;
    return 1;
#endif
}

int sdm_thread(void)
{
#ifdef _OPENMP
    return omp_get_thread_num();
#else
    return 0;
#endif
}
