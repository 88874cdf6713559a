/* Reading of whole files, atomic writing, creation of folders. */
#include "sdm/internal/file.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdbool.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "sdm/memory.h"

sdm_status sdm_file_read(const char *path, uint64_t max_bytes, uint8_t **data, size_t *size,
                         sdm_error *err)
{
    *data = NULL;
    *size = 0;
    // O_NONBLOCK: opening a FIFO must not wait for a writer
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK);
    if (fd < 0) return sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", path, strerror(errno));
    sdm_status s = SDM_OK;
    uint8_t *block = NULL;
    struct stat st;
    size_t n = 0;
    // check type and size
    if (fstat(fd, &st)) {
        s = sdm_fail(err, SDM_E_IO, "%s: cannot read its size: %s", path, strerror(errno));
        goto done;
    }
    if (!S_ISREG(st.st_mode)) {
        s = sdm_fail(err, SDM_E_IO, "%s: not a regular file", path);
        goto done;
    }
    if ((uint64_t)st.st_size > max_bytes) {
        s = sdm_fail(err, SDM_E_FORMAT,
                     "%s: %llu bytes, more than the %llu allowed for a file of this kind", path,
                     (unsigned long long)st.st_size, (unsigned long long)max_bytes);
        goto done;
    }
    // this can only happen with 32-bit addresses
    if ((uint64_t)st.st_size >= SIZE_MAX) {
        s = sdm_fail(err, SDM_E_NOMEM, "%s: %llu bytes are more than memory can hold", path,
                     (unsigned long long)st.st_size);
        goto done;
    }
    // read all bytes; the block has a zero byte at the end
    n = (size_t)st.st_size;
    if ((s = SDM_ALLOC(&block, n + 1, path, err))) goto done;
    for (size_t at = 0; at < n;) {
        const ssize_t got = read(fd, block + at, n - at);
        if (got < 0 && errno == EINTR) continue;
        if (got < 0) {
            s = sdm_fail(err, SDM_E_IO, "%s: cannot read: %s", path, strerror(errno));
            goto done;
        }
        if (got == 0) {
            s = sdm_fail(err, SDM_E_IO, "%s: ended after %zu of %zu bytes", path, at, n);
            goto done;
        }
        at += (size_t)got;
    }
done:
    close(fd);
    if (s) {
        sdm_free(block);
        return s;
    }
    *data = block;
    *size = n;
    return SDM_OK;
}

sdm_status sdm_file_read_text(const char *path, uint64_t max_bytes, char **text, size_t *size,
                              size_t *lines, sdm_error *err)
{
    uint8_t *data;
    sdm_status s = sdm_file_read(path, max_bytes, &data, size, err);
    *text = (char *)data;
    *lines = 1;
    if (s) return s;
    if (strlen(*text) != *size) {
        sdm_free(data);
        *text = NULL;
        return sdm_fail(err, SDM_E_FORMAT, "%s: not a text file (a zero byte)", path);
    }
    for (size_t i = 0; i < *size; i++) *lines += (*text)[i] == '\n';
    return SDM_OK;
}

#define BUFFER_BYTES 65536u

struct sdm_outfile {
    char *path, *temp;
    int fd;
    size_t filled;
    uint8_t buffer[BUFFER_BYTES];
};

static char *path_with_suffix(const char *path, const char *suffix)
{
    const size_t n = strlen(path), m = strlen(suffix);
    char *out = malloc(n + m + 1);
    if (!out) return NULL;
    memcpy(out, path, n);
    memcpy(out + n, suffix, m + 1);
    return out;
}

#define TEMPS_MAX 64

/* Names of the temporary files that are there, as far as there is room. */
static _Atomic(const char *) temps[TEMPS_MAX];

/* Puts `now` into the place of `was`. */
static void note_temp(const char *was, const char *now)
{
    for (size_t i = 0; i < TEMPS_MAX; i++) {
        const char *expected = was;
        if (atomic_compare_exchange_strong(&temps[i], &expected, now)) return;
    }
}

void sdm_outfile_remove_temps(void)
{
    for (size_t i = 0; i < TEMPS_MAX; i++) {
        const char *name = atomic_load(&temps[i]);
        if (name) unlink(name);
    }
}

/* Creates a temporary file with a unique name (`path`, process id and a counter). Returns its file
 * descriptor, or -1 with errno set. *temp = the name of the file, to be freed; NULL on error. */
static int temp_open(const char *path, char **temp)
{
    static atomic_ulong counter;
    for (;;) {
        char suffix[64];
        snprintf(suffix, sizeof suffix, ".%ld.%lu.tmp", (long)getpid(),
                 atomic_fetch_add(&counter, 1));
        *temp = path_with_suffix(path, suffix);
        if (!*temp) errno = ENOMEM;
        const int fd = *temp ? open(*temp, O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666) : -1;
        if (fd >= 0) return fd;
        const int code = errno;
        free(*temp);
        *temp = NULL;
        errno = code;
        if (code != EEXIST) return -1;
    }
}

bool sdm_outfile_is_temp(const char *name, const char *of)
{
    const size_t n = strlen(of);
    if (strncmp(name, of, n)) return false;
    name += n;
    for (int part = 0; part < 2; part++) {
        const size_t digits = *name == '.' ? strspn(name + 1, "0123456789") : 0;
        if (digits == 0) return false;
        name += 1 + digits;
    }
    return !strcmp(name, ".tmp");
}

/* Gives the open file the permissions of the one that it replaces; its owner may always write it.
 * false: it cannot, see errno. WASI has no permissions. */
static bool keep_permissions(int fd, mode_t mode)
{
#ifdef __wasi__
    (void)fd, (void)mode;
    return true;
#else
    // some file systems have no permissions
    return !fchmod(fd, (mode & 0777) | S_IWUSR) || errno == EPERM || errno == ENOSYS ||
           errno == ENOTSUP;
#endif
}

sdm_status sdm_outfile_open(const char *path, sdm_outfile **out, sdm_error *err)
{
    *out = NULL;
    sdm_outfile *f = NULL;
    const sdm_status s = SDM_ALLOC(&f, 1, "output buffer", err);
    if (s) return s;
    f->fd = -1;
    f->path = path_with_suffix(path, "");
    if (!f->path) {
        sdm_outfile_discard(&f);
        return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for its name", path);
    }
    struct stat st;
    const bool replaces = !stat(path, &st);
    if (replaces && !S_ISREG(st.st_mode)) {
        sdm_outfile_discard(&f);
        return sdm_fail(err, SDM_E_IO, "%s: cannot write: it is a %s", path,
                        S_ISDIR(st.st_mode) ? "folder"
                                            : "device, pipe or socket, which a file would replace");
    }
    f->fd = temp_open(path, &f->temp);
    if (f->fd < 0) {
        const int code = errno;
        sdm_outfile_discard(&f);
        return sdm_fail(err, SDM_E_IO, "%s: cannot write: %s", path, strerror(code));
    }
    note_temp(NULL, f->temp);
    if (replaces && !keep_permissions(f->fd, st.st_mode)) {
        const int code = errno;
        sdm_outfile_discard(&f);
        return sdm_fail(err, SDM_E_IO, "%s: cannot set its permissions: %s", path, strerror(code));
    }
    *out = f;
    return SDM_OK;
}

const char *sdm_outfile_temp_path(const sdm_outfile *f) { return f->temp; }

sdm_status sdm_outfile_flush(sdm_outfile *f, sdm_error *err)
{
    for (size_t at = 0; at < f->filled;) {
        const ssize_t put = write(f->fd, f->buffer + at, f->filled - at);
        if (put < 0 && errno == EINTR) continue;
        if (put < 0)
            return sdm_fail(err, SDM_E_IO, "%s: cannot write: %s", f->path, strerror(errno));
        at += (size_t)put;
    }
    f->filled = 0;
    return SDM_OK;
}

sdm_status sdm_outfile_write(sdm_outfile *f, const void *data, size_t size, sdm_error *err)
{
    const uint8_t *p = data;
    while (size) {
        if (f->filled == BUFFER_BYTES) {
            const sdm_status s = sdm_outfile_flush(f, err);
            if (s) return s;
        }
        size_t n = BUFFER_BYTES - f->filled;
        if (n > size) n = size;
        memcpy(f->buffer + f->filled, p, n);
        f->filled += n, p += n, size -= n;
    }
    return SDM_OK;
}

sdm_status sdm_outfile_printf(sdm_outfile *f, sdm_error *err, const char *fmt, ...)
{
    va_list args, again;
    va_start(args, fmt);
    va_copy(again, args);
    const int n = vsnprintf(NULL, 0, fmt, args);
    va_end(args);
    char *text = n < 0 ? NULL : malloc((size_t)n + 1);
    if (text) vsnprintf(text, (size_t)n + 1, fmt, again);
    va_end(again);
    if (!text) return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for a line", f->path);
    const sdm_status s = sdm_outfile_write(f, text, (size_t)n, err);
    free(text);
    return s;
}

/* Makes the rename durable. Not every file system can sync a folder, so errors are ignored. */
static void folder_sync(const char *path)
{
    char *folder = path_with_suffix(path, "");
    if (!folder) return;
    char *slash = strrchr(folder, '/');
    if (slash) slash[slash == folder] = '\0';
    const int fd = open(slash ? folder : ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (fd >= 0) {
        fsync(fd);
        close(fd);
    }
    free(folder);
}

sdm_status sdm_outfile_commit(sdm_outfile **pf, sdm_error *err)
{
    sdm_outfile *f = *pf;
    sdm_status s = sdm_outfile_flush(f, err);
    // a library may have replaced the temporary file by another one of the same name: open it again
    // by its name for fsync()
    if (!s) {
        const int fd = open(f->temp, O_RDWR | O_CLOEXEC);
        if (fd < 0 || fsync(fd))
            s = sdm_fail(err, SDM_E_IO, "%s: cannot bring to disk: %s", f->path, strerror(errno));
        if (fd >= 0) close(fd);
    }
    const int closed = close(f->fd);
    f->fd = -1;
    if (!s && closed) s = sdm_fail(err, SDM_E_IO, "%s: cannot close: %s", f->path, strerror(errno));
    if (!s && rename(f->temp, f->path))
        s = sdm_fail(err, SDM_E_IO, "%s: cannot rename into place: %s", f->path, strerror(errno));
    if (s) {
        sdm_outfile_discard(pf);
        return s;
    }
    note_temp(f->temp, NULL);
    folder_sync(f->path);
    free(f->path);
    free(f->temp);
    sdm_free(f);
    *pf = NULL;
    return SDM_OK;
}

void sdm_outfile_discard(sdm_outfile **pf)
{
    sdm_outfile *f = *pf;
    if (!f) return;
    if (f->fd >= 0) close(f->fd);
    if (f->temp) unlink(f->temp);
    if (f->temp) note_temp(f->temp, NULL);
    free(f->path);
    free(f->temp);
    sdm_free(f);
    *pf = NULL;
}

sdm_status sdm_file_write(const char *path, const void *data, size_t size, sdm_error *err)
{
    sdm_outfile *file = NULL;
    sdm_status s = sdm_outfile_open(path, &file, err);
    if (!s) s = sdm_outfile_write(file, data, size, err);
    if (!s) return sdm_outfile_commit(&file, err);
    sdm_outfile_discard(&file);
    return s;
}

sdm_status sdm_make_folder(const char *path, sdm_error *err)
{
    if (!*path) return sdm_fail(err, SDM_E_ARG, "the name of a folder is empty");
    char *name = path_with_suffix(path, "");
    if (!name) return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for its name", path);
    sdm_status s = SDM_OK;
    for (char *at = name + 1; !s; at++) {
        if (*at && *at != '/') continue;
        const char end = *at;
        *at = '\0';
        struct stat st;
        if (mkdir(name, 0777) && (errno != EEXIST || stat(name, &st) || !S_ISDIR(st.st_mode)))
            s = sdm_fail(err, SDM_E_IO, "%s: cannot make the folder: %s", name, strerror(errno));
        *at = end;
        if (!end) break;
    }
    free(name);
    return s;
}

size_t sdm_folder_existing(const char *path)
{
    char *name = path_with_suffix(path, "");
    size_t length = name ? strlen(name) : 0;
    // without memory nothing counts as made
    if (!name) return strlen(path);
    while (length > 0) {
        name[length] = '\0';
        if (!access(name, F_OK)) break;
        while (length > 0 && name[--length] != '/') {
        }
    }
    free(name);
    return length;
}

void sdm_folder_remove_empty(const char *path, size_t existing)
{
    char *name = path_with_suffix(path, "");
    size_t length = name ? strlen(name) : 0;
    while (length > existing) {
        name[length] = '\0';
        // an empty name between two slashes is no folder of its own
        if (name[length - 1] != '/' && rmdir(name)) break;
        while (length > 0 && name[--length] != '/') {
        }
    }
    free(name);
}
