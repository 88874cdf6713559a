/* What a process made by fork() does first. */
#pragma once

#include "sdm/internal/shared.h"

#ifdef __cplusplus
extern "C" {
#endif

/* The calling process, which fork() has made, ends with its parent, by SIGKILL: it would otherwise
 * go on alone, and hold the locks of the parent. `parent` is the parent's getpid() from before
 * fork(). The thread of the parent that called fork() must not end before the child. On systems
 * other than Linux the child ends here if the parent has ended already, and goes on otherwise. */
SDM_INTERNAL_API void sdm_child_ends_with(long parent);

#ifdef __cplusplus
}
#endif
