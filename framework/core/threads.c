/* Numbers of threads. */
#include "sdm/internal/threads.h"

#ifdef _OPENMP
#include <omp.h>
#endif

/* So many on a small machine, too: tests ask for more than it has. */
#define MOST 64

int sdm_threads(int wanted)
{
#ifdef _OPENMP
    const int n = wanted > 0 ? wanted : omp_get_max_threads(), twice = 2 * omp_get_num_procs();
    const int most = twice > MOST ? twice : MOST;
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
