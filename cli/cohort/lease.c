/* Leases: numbered files, lease-1, lease-2, ... A process holds the case if it created the file of
 * the highest number. It may create the next one only when the last one is stale. Since a file is
 * created exclusively and a stale one stays where it is, two processes never take over the same
 * lease: the one that comes second finds the next number taken. */
#define _DEFAULT_SOURCE // gethostname()
#include "cohort.h"

#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <time.h>
#include <unistd.h>

#include "sdm/internal/clock.h"

#define RENEW_SECONDS 30
#define STALE_SECONDS 180

enum { NUMBER_MAX_LEASES = 10000 };

typedef char lease_path[CLI_CASE_PATH_MAX + 16];

static void path_of(const cli_lease *lease, unsigned number, lease_path path)
{
    snprintf(path, sizeof(lease_path), "%s-%u", lease->path, number);
}

/* host = the name of this host and, since containers may share it, the number of its space of
 * process numbers. */
static void name_host(char host[140])
{
    char name[100] = "";
    struct stat st;
    gethostname(name, sizeof name - 1);
    for (char *at = name; *at; at++)
        if (*at == ' ' || *at == '\n') *at = '_';
    const bool known = !stat("/proc/self/ns/pid", &st);
    snprintf(host, 140, "%s/%llu", *name ? name : "?", known ? (unsigned long long)st.st_ino : 0);
}

/* *age = seconds since the file was written or renewed, by the clock of the machine that holds it:
 * that of a file made there now. false: it cannot be told. */
static bool measure_age(const cli_lease *lease, const struct stat *st, double *age)
{
    char probe[CLI_CASE_PATH_MAX + 64];
    struct stat now;
    snprintf(probe, sizeof probe, "%s.%ld.0.tmp", lease->path, (long)getpid());
    const int fd = open(probe, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    const bool known = fd >= 0 && write(fd, "?", 1) == 1 && !fstat(fd, &now);
    if (fd >= 0) close(fd), unlink(probe);
    if (known) *age = difftime(now.st_mtime, st->st_mtime);
    return known;
}

/* What a lease says. */
typedef struct lease_text {
    char host[140];
    long process;
} lease_text;

static bool read_lease(int fd, lease_text *out)
{
    char text[320] = "";
    const ssize_t n = pread(fd, text, sizeof text - 1, 0);
    return n > 0 && sscanf(text, "host %139s process %ld", out->host, &out->process) == 2;
}

/* Whether a process of this host has ended. One that nobody waited for yet has ended, too. */
static bool is_dead(long process)
{
    char path[64], text[256] = "";
    if (kill((pid_t)process, 0) && errno == ESRCH) return true;
    snprintf(path, sizeof path, "/proc/%ld/stat", process);
    const int fd = open(path, O_RDONLY | O_CLOEXEC);
    const ssize_t n = fd < 0 ? -1 : read(fd, text, sizeof text - 1);
    if (fd >= 0) close(fd);
    const char *name_end = n > 0 ? strrchr(text, ')') : NULL;
    return name_end && name_end[1] == ' ' && name_end[2] == 'Z';
}

/* Judges the lease `number`, which another process has or had. *gone: the file is not there any
 * more. Returns whether it is stale; else *holder tells who has it. */
static bool is_stale(const cli_lease *lease, unsigned number, bool *gone, char holder[200])
{
    lease_path path;
    char here[140];
    lease_text of = {.process = 0};
    struct stat st;
    double age = 0;
    path_of(lease, number, path);
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NOFOLLOW | O_NONBLOCK);
    *gone = fd < 0 && errno == ENOENT;
    if (fd < 0 || fstat(fd, &st)) {
        if (fd >= 0) close(fd);
        snprintf(holder, 200, "a process whose lease cannot be read");
        return false;
    }
    const bool readable = read_lease(fd, &of);
    close(fd);
    name_host(here);
    const bool mine = readable && of.process > 0 && !strcmp(of.host, here);
    if (mine && is_dead(of.process)) return true;
    if (measure_age(lease, &st, &age) && age > STALE_SECONDS) return true;
    if (readable)
        snprintf(holder, 200, "process %ld on %.*s", of.process, (int)strcspn(of.host, "/"),
                 of.host);
    else
        snprintf(holder, 200, "another process");
    return false;
}

static int write_text(const char *path, const char *text)
{
    const size_t length = strlen(text);
    const int fd = open(path, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (fd < 0) return errno;
    errno = 0;
    int code = write(fd, text, length) == (ssize_t)length ? 0 : errno ? errno : EIO;
    if (close(fd) && !code) code = errno;
    if (code) unlink(path);
    return code;
}

/* Gives `temp` a second name, `path`, which must be new. Returns 0, or the error number. */
static int name_file(const char *temp, const char *path)
{
    struct stat st;
    const int code = link(temp, path) ? errno : 0;
    // a file server may answer twice: the second time the name exists
    return code == EEXIST && !stat(temp, &st) && st.st_nlink == 2 ? 0 : code;
}

/* Creates the lease `path` with this text. It appears under its name with all of its text: a
 * process that is killed never leaves a lease that does not tell whose it is. Returns 0, or the
 * error number. */
static int create_whole(const cli_lease *lease, const char *path, const char *text)
{
    enum { TRIES = 100 }; // names of temporary files; a process with this number may have left some
    for (int i = 0; i < TRIES; i++) {
        char temp[CLI_CASE_PATH_MAX + 64];
        snprintf(temp, sizeof temp, "%s.%ld.%d.tmp", lease->path, (long)getpid(), i);
        int code = write_text(temp, text);
        if (code == EEXIST) continue;
        if (code) return code;
        code = name_file(temp, path);
        unlink(temp);
        // the process that has the lease removes temporary files
        if (code == ENOENT) continue;
        const bool unable = code == EPERM || code == ENOTSUP || code == ENOSYS || code == EINVAL;
        return unable ? write_text(path, text) : code; // no second names in this file system
    }
    return EEXIST;
}

/* Creates the lease `number`. Returns 0, or the error number. */
static int create(const cli_lease *lease, unsigned number)
{
    lease_path path;
    char host[140], text[320], date[32] = "";
    const time_t now = time(NULL);
    struct tm utc;
    path_of(lease, number, path);
    name_host(host);
    if (gmtime_r(&now, &utc)) strftime(date, sizeof date, "%Y-%m-%dT%H:%M:%SZ", &utc);
    snprintf(text, sizeof text, "host %s process %ld since %s\n", host, (long)getpid(), date);
    return create_whole(lease, path, text);
}

sdm_status cli_lease_take(const char *folder, cli_lease *lease, char holder[200], sdm_error *err)
{
    snprintf(lease->path, sizeof lease->path, "%s/" CLI_CASE_LEASE, folder);
    lease->number = 0;
    *holder = '\0';
    for (unsigned number = 1; number < NUMBER_MAX_LEASES;) {
        bool gone = false;
        errno = 0;
        const int code = create(lease, number);
        if (!code) {
            lease->number = number;
            lease->renewed = sdm_clock();
            return SDM_OK;
        }
        if (code != EEXIST)
            return sdm_fail(err, SDM_E_IO, "%s-%u: cannot write: %s", lease->path, number,
                            strerror(code));
        const bool stale = is_stale(lease, number, &gone, holder);
        if (gone) // given back meanwhile
            number = 1;
        else if (stale)
            number++;
        else
            return SDM_OK;
        *holder = '\0';
    }
    return sdm_fail(err, SDM_E_IO, "%s-*: too many leases of dead processes: remove them",
                    lease->path);
}

void cli_lease_renew(cli_lease *lease)
{
    lease_path path;
    const double now = sdm_clock();
    if (!lease->number || now - lease->renewed < RENEW_SECONDS) return;
    path_of(lease, lease->number, path);
    // the file server's clock; a lease that somebody took over is no error: both make the same
    (void)utimensat(AT_FDCWD, path, NULL, 0);
    lease->renewed = now;
}

void cli_lease_release(cli_lease *lease, bool finished)
{
    lease_path path;
    // those of dead processes stay until the record is in place: else their numbers were free
    for (unsigned n = lease->number; n > 0; n--) {
        path_of(lease, n, path);
        unlink(path);
        if (!finished) break;
    }
    lease->number = 0;
}
