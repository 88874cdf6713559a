/* Remembers for each thread which third-party library it is calling. */
#include "sdm/internal/foreign.h"

#include <stdatomic.h>
#include <stddef.h>

static _Thread_local sdm_foreign running;
static atomic_int n_running;               /* threads that are calling a library */
static _Atomic(const char *) last_library; /* the library that was called last */

sdm_foreign sdm_foreign_enter(sdm_foreign now)
{
    const sdm_foreign before = running;
    running = now;
    if (now.library) atomic_store_explicit(&last_library, now.library, memory_order_relaxed);
    atomic_fetch_add(&n_running, (now.library != NULL) - (before.library != NULL));
    return before;
}

sdm_foreign sdm_foreign_running(void)
{
    if (running.library || atomic_load(&n_running) == 0) return running;
    return (sdm_foreign){atomic_load(&last_library), NULL};
}
