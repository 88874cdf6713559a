/* What a process made by fork() does first. */
#pragma once

#include <sys/types.h>
#include <unistd.h>
#ifdef __linux__
#include <signal.h>
#include <sys/prctl.h>
#endif

/* The calling process, which fork() has made, ends with its parent, by SIGKILL: it would otherwise
 * go on alone, and hold the locks of the parent. `parent` is the parent's getpid() from before
 * fork(). The parent is the thread that called fork(): it must not end before the child. On systems
 * other than Linux the child ends here if the parent has ended already, and goes on otherwise. */
static inline void sdm_child_ends_with(pid_t parent)
{
#ifdef __linux__
    prctl(PR_SET_PDEATHSIG, SIGKILL);
#endif
    if (getppid() != parent) _exit(1); // the parent has ended before the line above
}
