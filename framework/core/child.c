/* Has the system kill a child process when its parent ends. */
#include "sdm/internal/child.h"

#ifdef __wasi__ // has no processes
void sdm_child_ends_with(long parent) { (void)parent; }
#else

#include <unistd.h>
#ifdef __linux__
#include <signal.h>
#include <sys/prctl.h>
#endif

void sdm_child_ends_with(long parent)
{
#ifdef __linux__
    prctl(PR_SET_PDEATHSIG, SIGKILL);
#endif
    if (getppid() != parent) _exit(1); // the parent had ended before prctl(): no signal will come
}
#endif
