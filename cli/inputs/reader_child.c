/* Runs a reader in a child process with limits of memory and time; its result comes back through a
 * pipe. */
#define _DEFAULT_SOURCE // sysconf(_SC_NPROCESSORS_ONLN)
#include "reader_child.h"

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>
#ifdef __GLIBC__
#include <malloc.h>
#endif

#include "report/terminal.h"
#include "sdm/internal/child.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/sanitized.h"
#include "sdm/memory.h"

#define MEGABYTE UINT64_C(1048576)

/* What the child sends first; `length` bytes follow: what it read, or the message of its error. */
typedef struct answer {
    sdm_status status;
    uint64_t length;
} answer;

typedef struct limits {
    uint64_t bytes, seconds;
} limits;

/* The file, the library that reads it, and its reader. */
typedef struct task {
    const char *path, *library;
    cli_reader *read;
    const void *user;
    limits most;
} task;

static limits limits_of(uint64_t file_bytes)
{
    return (limits){512 * MEGABYTE + 32 * file_bytes, 2 + file_bytes / 1000000};
}

static void set_limit(int resource, uint64_t value)
{
    // a second more to the hard limit: the signal at the soft one tells time from other reasons
    const struct rlimit limit = {(rlim_t)value, (rlim_t)value + 1};
    setrlimit(resource, &limit);
}

/* The address space counts the stacks of the library's threads; one heap serves them all.
 * Sanitizers need terabytes of it. */
static void limit_child(limits most)
{
#ifdef __GLIBC__
    (void)mallopt(M_ARENA_MAX, 1);
#endif
    const uint64_t stacks = (uint64_t)sysconf(_SC_NPROCESSORS_ONLN) * 16 * MEGABYTE;
    if (!SDM_SANITIZED) set_limit(RLIMIT_AS, sdm_address_space() + most.bytes + stacks);
    set_limit(RLIMIT_CPU, most.seconds);
    set_limit(RLIMIT_CORE, 0);
}

static bool send_all(int fd, const void *data, size_t size)
{
    for (const char *at = data; size;) {
        const ssize_t put = write(fd, at, size);
        if (put < 0 && errno == EINTR) continue;
        if (put <= 0) return false;
        at += put, size -= (size_t)put;
    }
    return true;
}

/* The work of the child; what libraries print about a damaged file is not for the user. */
_Noreturn static void child(const task *t, int to_parent)
{
    const int nowhere = open("/dev/null", O_WRONLY);
    if (nowhere >= 0) dup2(nowhere, STDOUT_FILENO), dup2(nowhere, STDERR_FILENO);
    limit_child(t->most);
    char *bytes = NULL;
    size_t size = 0;
    sdm_error err = {0};
    const sdm_status s = t->read(t->user, t->path, &bytes, &size, &err);
    const answer a = {s, s ? strlen(err.text) : size};
    const bool sent = send_all(to_parent, &a, sizeof a) &&
                      send_all(to_parent, s ? err.text : bytes, (size_t)a.length);
    _exit(sent ? 0 : 1);
}

/* The child, as its parent sees it. */
typedef struct reader {
    pid_t pid;
    int fd;          /* end of the pipe */
    double deadline; /* time after which it is ended, by sdm_clock() */
    bool late;       /* it was ended for that */
} reader;

/* Waits until something can be read. Ends the child and returns false after an interrupt or the
 * deadline: a child that waits for ever uses no processor time. */
static bool wait_for(reader *r)
{
    for (;;) {
        struct pollfd p = {.fd = r->fd, .events = POLLIN};
        if (poll(&p, 1, 200) > 0) return true;
        r->late = sdm_clock() > r->deadline;
        if (!r->late && !cli_is_interrupted()) continue;
        kill(r->pid, SIGKILL);
        return false;
    }
}

static bool receive(reader *r, void *data, size_t size)
{
    for (char *at = data; size;) {
        if (!wait_for(r)) return false;
        const ssize_t got = read(r->fd, at, size);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return false;
        at += got, size -= (size_t)got;
    }
    return true;
}

/* The message for a child that ended without an answer. */
static sdm_status explain(const task *t, const reader *r, int ended, sdm_error *err)
{
    const char *path = t->path;
    const sdm_status s = cli_check_interrupt(err);
    if (s) return s;
    if (r->late)
        return sdm_fail(err, SDM_E_IO, "%s: reading it does not end: is the disk there?", path);
    if (WIFSIGNALED(ended) && WTERMSIG(ended) == SIGXCPU)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: reading it takes more than %llu s", path,
                        (unsigned long long)t->most.seconds);
    if (WIFSIGNALED(ended) && WTERMSIG(ended) == SIGKILL)
        return sdm_fail(err, SDM_E_IO, "%s: the process that read it was killed", path);
    return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: %s crashes while it reads the file", path,
                    t->library);
}

static sdm_status read_answer(const task *t, reader *r, bool *complete, char **bytes, size_t *size,
                              sdm_error *err)
{
    answer a = {0};
    char *said = NULL;
    *complete = receive(r, &a, sizeof a);
    if (!*complete) return SDM_OK;
    if (a.length > t->most.bytes)
        return sdm_fail(err, SDM_E_FORMAT, "%s: damaged: it holds too much for its size", t->path);
    sdm_status s = SDM_ALLOC(&said, (size_t)a.length + 1, "content of the file", err);
    if (s) return s;
    *complete = receive(r, said, (size_t)a.length);
    if (*complete && a.status == SDM_E_NOMEM)
        s = sdm_fail(err, SDM_E_FORMAT,
                     "%s: damaged: it asks for more than %llu MB of memory, which a file of its "
                     "size does not need",
                     t->path, (unsigned long long)(t->most.bytes / MEGABYTE));
    else if (*complete && a.status)
        s = sdm_fail(err, a.status, "%s", said);
    if (s || !*complete) {
        sdm_free(said);
        return s;
    }
    *bytes = said;
    *size = (size_t)a.length;
    return SDM_OK;
}

static sdm_status check_regular(const char *path, uint64_t *bytes, sdm_error *err)
{
    struct stat st;
    if (stat(path, &st))
        return sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode)) return sdm_fail(err, SDM_E_IO, "%s: not a regular file", path);
    *bytes = (uint64_t)st.st_size;
    return SDM_OK;
}

sdm_status cli_read_in_child(const char *path, const char *library, cli_reader *read,
                             const void *user, char **bytes, size_t *size, sdm_error *err)
{
    *bytes = NULL;
    *size = 0;
    uint64_t file_bytes = 0;
    sdm_status s = check_regular(path, &file_bytes, err);
    if (s) return s;
    const task t = {path, library, read, user, limits_of(file_bytes)};
    int ends[2];
    if (pipe(ends)) return sdm_fail(err, SDM_E_IO, "%s: no pipe: %s", path, strerror(errno));
    const pid_t parent = getpid(), pid = sdm_child_fork();
    if (pid == 0) {
        sdm_child_ends_with(parent);
        close(ends[0]);
        child(&t, ends[1]);
    }
    close(ends[1]);
    if (pid < 0) {
        s = sdm_fail(err, SDM_E_IO, "%s: no process to read it: %s", path, strerror(errno));
        close(ends[0]);
        return s;
    }
    bool complete = false;
    reader r = {.pid = pid, .fd = ends[0], .deadline = sdm_clock() + 60.0 * (double)t.most.seconds};
    s = read_answer(&t, &r, &complete, bytes, size, err);
    close(ends[0]);
    int ended = 0;
    while (waitpid(pid, &ended, 0) < 0 && errno == EINTR) {
    }
    return s || complete ? s : explain(&t, &r, ended, err);
}
