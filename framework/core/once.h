/* One-time initialisation by the first thread that needs it (pthread_once). */
#pragma once

#if defined(__wasi__) && !defined(_REENTRANT)
/* WebAssembly without threads: its C library has no pthread.h. */
typedef int sdm_once;
#define SDM_ONCE_INIT 0
static inline void sdm_once_run(sdm_once *once, void (*work)(void))
{
    if (!*once) work();
    *once = 1;
}
#else
#include <pthread.h>

typedef pthread_once_t sdm_once;
#define SDM_ONCE_INIT PTHREAD_ONCE_INIT
static inline void sdm_once_run(sdm_once *once, void (*work)(void))
{
    (void)pthread_once(once, work);
}
#endif
