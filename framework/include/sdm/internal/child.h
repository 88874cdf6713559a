/* Child processes made by fork(). */
#pragma once

#include "sdm/internal/shared.h"

#ifdef __cplusplus
extern "C" {
#endif

/* As fork(): returns 0 in the child, the number of the child in the parent, -1 and errno on errors.
 * A build with AddressSanitizer or ThreadSanitizer first waits, for at most a second, until all
 * other threads sleep: if one of them holds the lock of AddressSanitizer's allocator (gcc 12)
 * during the fork, this lock stays locked in the child for ever. Threads that a library starts when
 * it is loaded are enough for that. */
SDM_INTERNAL_API int sdm_child_fork(void);

/* Call this in a child that sdm_child_fork() has made: the system then kills the child (SIGKILL)
 * when its parent ends. Otherwise the child would go on alone, and hold the locks of the parent.
 * `parent` is the parent's getpid() from before the fork. The thread of the parent that forked must
 * not end before the child. On systems other than Linux the child ends here if the parent has ended
 * already, and goes on otherwise. */
SDM_INTERNAL_API void sdm_child_ends_with(long parent);

#ifdef __cplusplus
}
#endif
