/* Child processes made by fork(). */
#pragma once

#include "sdm/internal/shared.h"

#ifdef __cplusplus
extern "C" {
#endif

/* As fork(): 0 in the child, its number in the parent, -1 and errno on errors. A build with
 * AddressSanitizer waits first, for at most a second, until all other threads sleep: its allocator
 * (of gcc 12) stays locked in the child for ever if a thread held the lock at that moment. The
 * threads that a library starts when it is loaded are enough for that. */
SDM_INTERNAL_API int sdm_child_fork(void);

/* The calling process, which sdm_child_fork() has made, ends with its parent, by SIGKILL: it would
 * otherwise go on alone, and hold the locks of the parent. `parent` is the parent's getpid() from
 * before the fork. The thread of the parent that forked must not end before the child. On systems
 * other than Linux the child ends here if the parent has ended already, and goes on otherwise. */
SDM_INTERNAL_API void sdm_child_ends_with(long parent);

#ifdef __cplusplus
}
#endif
