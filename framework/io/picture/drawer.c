/* The child process that draws a picture: start, limits, its answer, messages about its end. */
#define _DEFAULT_SOURCE // for glibc's mallopt()
#include "drawer.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "sdm/internal/child.h"
#include "sdm/internal/picture_child.h"

/* Seconds of processor time after which a child does not draw any more; the largest picture takes
 * less than a tenth. */
enum { SECONDS_MAX = 600 };

static bool child_wanted;
static int to_parent; // in the child: the end of the pipe

void sdm_picture_in_child(bool wanted) { child_wanted = wanted; }

/* Prepares the child: it ends with its parent, and a crash ends it without a word. Memory from
 * malloc() is filled with a byte, so that a jump to an address in it never leads back into a
 * function of the program. */
static void become_child(pid_t parent, int fd)
{
    sdm_child_ends_with(parent);
    static const int crashes[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
    for (size_t i = 0; i < sizeof crashes / sizeof *crashes; i++) signal(crashes[i], SIG_DFL);
    const struct rlimit time = {SECONDS_MAX, SECONDS_MAX}, core = {0, 0};
    setrlimit(RLIMIT_CPU, &time);
    setrlimit(RLIMIT_CORE, &core);
    const int nowhere = open("/dev/null", O_WRONLY);
    if (nowhere >= 0) dup2(nowhere, STDOUT_FILENO), dup2(nowhere, STDERR_FILENO);
#ifdef M_PERTURB
    (void)mallopt(M_PERTURB, 0xAA);
#endif
    to_parent = fd;
}

void sdm_drawer_end(sdm_status s, const sdm_error *err)
{
    sdm_error answer = {0};
    if (s) answer = *err;
    answer.status = s;
    const char *at = (const char *)&answer, *end = at + sizeof answer;
    while (at < end) {
        const ssize_t put = write(to_parent, at, (size_t)(end - at));
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0) _exit(1);
        at += put;
    }
    _exit(0);
}

/* Reads the answer of the child; false: it has ended without one. */
static bool receive(int fd, sdm_error *answer)
{
    char *at = (char *)answer, *end = at + sizeof *answer;
    while (at < end) {
        const ssize_t got = read(fd, at, (size_t)(end - at));
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        at += got;
    }
    answer->text[sizeof answer->text - 1] = '\0';
    return true;
}

static sdm_status explain(const char *path, int ended, sdm_error *err)
{
    const int number = WIFSIGNALED(ended) ? WTERMSIG(ended) : 0;
    if (number == SIGXCPU || number == SIGKILL)
        return sdm_fail(err, SDM_E_IO, "%s: the process that drew it %s", path,
                        number == SIGKILL ? "was killed" : "did not end");
    return sdm_fail(err, SDM_E_NOMEM,
                    "%s: cairo crashed while it drew: it does so where memory is too short", path);
}

static sdm_status wait_for(const char *path, pid_t pid, int fd, sdm_error *err)
{
    sdm_error answer;
    int ended = 0;
    const bool complete = receive(fd, &answer);
    while (waitpid(pid, &ended, 0) < 0 && errno == EINTR) {
    }
    if (!complete) return explain(path, ended, err);
    return answer.status ? sdm_fail(err, answer.status, "%s", answer.text) : SDM_OK;
}

sdm_status sdm_drawer_start(const char *path, sdm_drawer_part *part, sdm_error *err)
{
    *part = SDM_DRAWS_ITSELF;
    int ends[2];
    if (!child_wanted || pipe(ends)) return SDM_OK;
    const pid_t parent = getpid(), pid = sdm_child_fork();
    if (pid == 0) {
        close(ends[0]);
        become_child(parent, ends[1]);
        *part = SDM_DRAWS_AS_CHILD;
        return SDM_OK;
    }
    close(ends[1]);
    sdm_status s = SDM_OK;
    if (pid > 0) {
        *part = SDM_HAS_CHILD_DRAWN;
        s = wait_for(path, pid, ends[0], err);
    }
    close(ends[0]);
    return s;
}
