/* The third-party library that a thread is calling. Some libraries crash where an allocation fails;
 * the handler of the crash then names the library and the file that it was writing. */
#pragma once

#include "sdm/internal/shared.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_foreign {
    const char *library; /* a constant: "OpenVDB"; NULL: none is being called */
    const char *path;    /* the file that it writes; NULL: not known */
} sdm_foreign;

/* Notes that the calling thread now calls the library `now`, and returns the library noted before;
 * pass the result to this function after the call. The path must stay valid until then. */
SDM_INTERNAL_API sdm_foreign sdm_foreign_enter(sdm_foreign now);

/* The library that the calling thread is calling. If there is none, but another thread is calling a
 * library, the calling thread may be a worker of that library: then the result is that library,
 * with path NULL. May be called in a signal handler. */
sdm_foreign sdm_foreign_running(void);

#ifdef __cplusplus
}
#endif
