/* The library of other authors that is at work: some of them crash where an allocation fails, and
 * whoever ends the process there can name the library and its file. */
#pragma once

#include "sdm/internal/shared.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct sdm_foreign {
    const char *library; /* a constant: "OpenVDB"; NULL: none is at work */
    const char *path;    /* the file that it writes; NULL: not known */
} sdm_foreign;

/* Notes what is at work in the calling thread from now on, and returns what was before, to be noted
 * again at the end. The path must stay valid until then. */
SDM_INTERNAL_API sdm_foreign sdm_foreign_enter(sdm_foreign now);

/* What is at work in the calling thread. If that is none, but a library is at work in another
 * thread, this thread may be one of that library's: the result is that library without the path.
 * May be called in a signal handler. */
sdm_foreign sdm_foreign_running(void);

#ifdef __cplusplus
}
#endif
