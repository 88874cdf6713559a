/* Child processes made by fork(). */
#include "sdm/internal/child.h"

#ifdef __wasi__ // has no processes
int sdm_child_fork(void) { return -1; }
void sdm_child_ends_with(long parent) { (void)parent; }
#else

#include <unistd.h>
#ifdef __linux__
#include <dirent.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <time.h>
#endif

#include "sdm/internal/sanitized.h"

#if defined(__linux__) && SDM_SANITIZED
/* Tells whether the thread with this number sleeps. A thread that has ended counts as asleep. */
static bool is_asleep(long thread)
{
    char path[64], text[512] = "";
    snprintf(path, sizeof path, "/proc/self/task/%ld/stat", thread);
    FILE *f = fopen(path, "r");
    if (!f) return true;
    text[fread(text, 1, sizeof text - 1, f)] = '\0';
    fclose(f);
    const char *name_end = strrchr(text, ')'); // "1234 (sdmgen) S 1 ..."
    return !name_end || strchr("SZX", name_end[1] ? name_end[2] : 'S');
}

/* Tells whether all threads of the process but the calling one sleep. */
static bool others_sleep(void)
{
    DIR *threads = opendir("/proc/self/task");
    int awake = 0;
    for (const struct dirent *d; threads && (d = readdir(threads));) {
        const long thread = strtol(d->d_name, NULL, 10); // 0: "." or ".."
        awake += thread && !is_asleep(thread);
    }
    if (threads) closedir(threads);
    return awake <= 1;
}

/* Waits at most a second. */
static void wait_for_sleep(void)
{
    enum { LOOKS = 1000 };
    static const struct timespec PAUSE = {.tv_nsec = 1000000};
    for (int i = 0; i < LOOKS && !others_sleep(); i++) nanosleep(&PAUSE, NULL);
}
#else
static void wait_for_sleep(void) {}
#endif

int sdm_child_fork(void)
{
    wait_for_sleep();
    return (int)fork();
}

void sdm_child_ends_with(long parent)
{
#ifdef __linux__
    prctl(PR_SET_PDEATHSIG, SIGKILL);
#endif
    if (getppid() != parent) _exit(1); // the parent had ended before prctl(): no signal will come
}
#endif
