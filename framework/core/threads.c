/* Number of threads, and number of the calling thread. */
#include "sdm/internal/threads.h"

#ifdef _OPENMP
#include <omp.h>
#endif

/* At least this many threads are allowed, because tests use more threads than a small machine has
 * processors. */
#define LIMIT_MIN 64

int sdm_threads(int wanted)
{
#ifdef _OPENMP
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
