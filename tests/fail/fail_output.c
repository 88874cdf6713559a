/* Makes output operations of a program fail, or kills it at one of them: preload this file
   (LD_PRELOAD). An operation is to open a regular file for writing, to write or close such a file,
   fsync(), rename() or mkdir(); standard output and error do not count.
     FAIL_AT=n         the n-th operation, from 1, fails; 0: none
     FAIL_MODE=once    that one alone, with EIO
               lasting that one and all later ones, with ENOSPC
               kill    SIGKILL before that one
               half    SIGKILL after half of it, if it is a write
     FAIL_COUNT=file   file.output receives the number of operations at the exit */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

enum { FILES_MAX = 4096 };

static atomic_long *operations;          /* shared with child processes */
static atomic_bool is_output[FILES_MAX]; /* by descriptor: opened for writing */
static long fail_at;
static const char *mode = "once";

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

__attribute__((constructor)) static void begin(void)
{
    const char *n = getenv("FAIL_AT"), *m = getenv("FAIL_MODE");
    operations =
        mmap(NULL, sizeof *operations, PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (operations == MAP_FAILED) _exit(99);
    if (n) fail_at = atol(n);
    if (m) mode = m;
}

__attribute__((destructor)) static void end(void)
{
    const char *path = getenv("FAIL_COUNT");
    if (!path) return;
    char text[32], name[4096];
    snprintf(name, sizeof name, "%s.output", path);
    const int n = snprintf(text, sizeof text, "%ld\n", operations ? (long)*operations : 0),
              fd = REAL(open)(name, O_WRONLY | O_CREAT | O_TRUNC, 0666);
    if (fd >= 0 && REAL(write)(fd, text, (size_t)n) == n) REAL(close)(fd);
}

/* Counts an operation. Returns true, with errno set, if it has to fail; *half (may be NULL): if the
 * process has to be killed after half of it. */
static bool fails(bool *half)
{
    const long n = atomic_fetch_add(operations, 1) + 1;
    if (!fail_at || n < fail_at) return false;
    const bool lasting = !strcmp(mode, "lasting"), in_half = !strcmp(mode, "half") && half;
    if (n > fail_at && !lasting) return false;
    errno = lasting ? ENOSPC : EIO;
    if (lasting || !strcmp(mode, "once")) return true;
    if (in_half)
        *half = true;
    else
        kill(getpid(), SIGKILL);
    return false;
}

static bool counts(int fd) { return fd > 2 && fd < FILES_MAX && is_output[fd]; }

/* Remembers a file that was opened for writing. */
static void remember(int fd)
{
    struct stat st;
    if (fd > 2 && fd < FILES_MAX) is_output[fd] = !fstat(fd, &st) && S_ISREG(st.st_mode);
}

#define OPEN(name)                                                                                 \
    int name(const char *path, int flags, ...)                                                     \
    {                                                                                              \
        va_list list;                                                                              \
        va_start(list, flags);                                                                     \
        const mode_t bits = flags & O_CREAT ? (mode_t)va_arg(list, int) : 0;                       \
        va_end(list);                                                                              \
        const bool writes = (flags & O_ACCMODE) != O_RDONLY;                                       \
        if (writes && strncmp(path, "/dev/", 5) && fails(NULL)) return -1;                         \
        const int fd = REAL(name)(path, flags, bits);                                              \
        if (writes) remember(fd);                                                                  \
        return fd;                                                                                 \
    }
OPEN(open)
OPEN(open64)

#define FOPEN(name)                                                                                \
    FILE *name(const char *path, const char *how)                                                  \
    {                                                                                              \
        const bool writes = strpbrk(how, "wa+") != NULL;                                           \
        if (writes && fails(NULL)) return NULL;                                                    \
        FILE *f = REAL(name)(path, how);                                                           \
        if (f && writes) remember(fileno(f));                                                      \
        return f;                                                                                  \
    }
FOPEN(fopen)
FOPEN(fopen64)

ssize_t write(int fd, const void *bytes, size_t n)
{
    bool half = false;
    if (counts(fd) && fails(&half)) return -1;
    if (!half) return REAL(write)(fd, bytes, n);
    if (REAL(write)(fd, bytes, n / 2) >= 0) kill(getpid(), SIGKILL);
    return -1;
}

ssize_t writev(int fd, const struct iovec *blocks, int n)
{
    if (counts(fd) && fails(NULL)) return -1;
    return REAL(writev)(fd, blocks, n);
}

int fsync(int fd) { return fails(NULL) ? -1 : REAL(fsync)(fd); }

int close(int fd)
{
    const bool output = counts(fd);
    if (output) is_output[fd] = false;
    const bool failed = output && fails(NULL);
    const int code = errno, closed = REAL(close)(fd);
    if (failed) errno = code;
    return failed ? -1 : closed;
}

int fclose(FILE *f)
{
    const int fd = fileno(f);
    const bool output = counts(fd);
    if (output) is_output[fd] = false;
    const bool failed = output && fails(NULL);
    const int code = errno, closed = REAL(fclose)(f);
    if (failed) errno = code;
    return failed ? EOF : closed;
}

int rename(const char *from, const char *to) { return fails(NULL) ? -1 : REAL(rename)(from, to); }

int mkdir(const char *path, mode_t bits) { return fails(NULL) ? -1 : REAL(mkdir)(path, bits); }
