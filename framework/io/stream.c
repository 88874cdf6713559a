/* Reads an image file from front to back, with or without decompression. */
#include "stream.h"

#include <errno.h>
#include <fcntl.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#define ANY_WINDOW (15 + 32) /* zlib: 32 KiB window, gzip or zlib wrapper */
/* Largest ratio of uncompressed to compressed bytes of deflate (zlib's technical notes). */
#define DEFLATE_RATIO 1032
#define PART_MAX ((size_t)1 << 30) /* zlib counts in unsigned int */

/* Opens `path`; flags: O_NOFOLLOW or 0. A FIFO is opened without waiting for a writer, and refused.
 */
static sdm_status open_file(sdm_stream *in, const char *path, int flags, sdm_error *err)
{
    memset(in, 0, sizeof *in);
    const size_t n = strlen(path);
    if (n >= sizeof in->path)
        return sdm_fail(err, SDM_E_ARG, "%.80s...: the name of the file is too long", path);
    memcpy(in->path, path, n);
    struct stat st;
    const int fd = open(path, O_RDONLY | O_CLOEXEC | O_NONBLOCK | flags);
    if (fd < 0 && errno == ELOOP && flags)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: a symbolic link, which is not followed: put the file itself there",
                        path);
    in->file = fd < 0 || fstat(fd, &st) ? NULL : fdopen(fd, "rb");
    const int code = errno;
    if (!in->file && fd >= 0) close(fd);
    if (!in->file) return sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", path, strerror(code));
    if (!S_ISREG(st.st_mode)) return sdm_fail(err, SDM_E_IO, "%s: not a regular file", path);
    in->left = (uint64_t)st.st_size;
    in->at = in->end = in->bytes;
    return SDM_OK;
}

sdm_status sdm_stream_open(sdm_stream *in, const char *path, sdm_error *err)
{
    return open_file(in, path, 0, err);
}

void sdm_stream_close(sdm_stream *in)
{
    if (in->zip) inflateEnd(&in->z);
    if (in->file) fclose(in->file);
    in->zip = false;
    in->file = NULL;
}

sdm_status sdm_stream_detach(sdm_stream *in, const char *name, sdm_error *err)
{
    char path[sizeof in->path];
    if (name[0] == '.' && name[1] == '/') name += 2;
    if (!*name || strpbrk(name, "/\\:") || !strcmp(name, ".") || !strcmp(name, ".."))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: its voxels are in '%.200s': a file of another folder is not opened, "
                        "put it beside the header and "
                        "name it there without a folder",
                        in->path, name);
    const char *slash = strrchr(in->path, '/');
    const int folder = slash ? (int)(slash + 1 - in->path) : 0;
    const int n = snprintf(path, sizeof path, "%.*s%s", folder, in->path, name);
    if (n < 0 || (size_t)n >= sizeof path)
        return sdm_fail(err, SDM_E_FORMAT, "%s: the name of the file of its voxels is too long",
                        in->path);
    char header[sizeof in->path];
    memcpy(header, in->path, sizeof header);
    sdm_stream_close(in);
    const sdm_status s = open_file(in, path, O_NOFOLLOW, err);
    in->detached = true;
    return s ? sdm_fail_in(err, s, "%s", header) : SDM_OK;
}

/* Refills the buffer when it holds less than two bytes, since sdm_stream_is_gzip() looks at two. */
static sdm_status fill_buffer(sdm_stream *in, sdm_error *err)
{
    const size_t kept = (size_t)(in->end - in->at), room = sizeof in->bytes - kept;
    if (kept >= 2 || in->left == 0) return SDM_OK;
    const size_t want = in->left < room ? (size_t)in->left : room;
    if (kept > 0) in->bytes[0] = *in->at;
    const size_t got = fread(in->bytes + kept, 1, want, in->file);
    if (got < want && ferror(in->file))
        return sdm_fail(err, SDM_E_IO, "%s: cannot read: %s", in->path, strerror(errno));
    if (got < want)
        return sdm_fail(err, SDM_E_IO, "%s: became shorter while it was read", in->path);
    in->at = in->bytes;
    in->end = in->bytes + kept + got;
    in->left -= got;
    return SDM_OK;
}

bool sdm_stream_is_gzip(sdm_stream *in)
{
    return !fill_buffer(in, NULL) && in->end - in->at >= 2 && in->at[0] == 0x1F &&
           in->at[1] == 0x8B;
}

sdm_status sdm_stream_unzip(sdm_stream *in, sdm_error *err)
{
    if (inflateInit2(&in->z, ANY_WINDOW) != Z_OK)
        return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for its decompression", in->path);
    in->zip = true;
    return SDM_OK;
}

/* Calls inflate() once, which writes at most `size` bytes to out; *got = how many. Sets in->ended
   after the last byte. */
static sdm_status inflate_part(sdm_stream *in, uint8_t *out, size_t size, size_t *got,
                               sdm_error *err)
{
    const size_t n = (size_t)(in->end - in->at);
    if (n == 0) return sdm_fail(err, SDM_E_FORMAT, "%s: the compressed data are cut off", in->path);
    in->z.next_in = (z_const Bytef *)in->at;
    in->z.avail_in = (uInt)n;
    in->z.next_out = out;
    in->z.avail_out = (uInt)(size < PART_MAX ? size : PART_MAX);
    const uInt room = in->z.avail_out;
    const int state = inflate(&in->z, Z_NO_FLUSH);
    in->at = in->end - in->z.avail_in;
    *got = room - in->z.avail_out;
    if (state == Z_MEM_ERROR)
        return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for its decompression", in->path);
    if (state == Z_OK || state == Z_BUF_ERROR) return SDM_OK;
    if (state != Z_STREAM_END)
        return sdm_fail(err, SDM_E_FORMAT, "%s: the compressed data are damaged (%s)", in->path,
                        in->z.msg ? in->z.msg : "a dictionary is missing");
    const sdm_status s = fill_buffer(in, err);
    in->ended = !s && in->at == in->end;
    // several gzip files may be concatenated, as bgzip does
    if (!s && !in->ended && (!sdm_stream_is_gzip(in) || inflateReset(&in->z) != Z_OK))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: bytes that belong to nothing follow the compressed data", in->path);
    return s;
}

/* Reads `size` bytes, or fewer at the end of the data; *taken = how many. */
static sdm_status read_some(sdm_stream *in, uint8_t *out, size_t size, size_t *taken,
                            sdm_error *err)
{
    sdm_status s = SDM_OK;
    *taken = 0;
    while (*taken < size && !in->ended && !s) {
        size_t n = 0;
        s = fill_buffer(in, err);
        if (!s && in->zip) {
            s = inflate_part(in, out + *taken, size - *taken, &n, err);
        } else if (!s) {
            n = (size_t)(in->end - in->at);
            in->ended = n == 0;
            if (n > size - *taken) n = size - *taken;
            memcpy(out + *taken, in->at, n);
            in->at += n;
        }
        *taken += n;
    }
    return s;
}

sdm_status sdm_stream_read(sdm_stream *in, void *out, size_t size, sdm_error *err)
{
    size_t taken;
    const sdm_status s = read_some(in, out, size, &taken, err);
    if (!s && taken < size)
        return sdm_fail(err, SDM_E_FORMAT, "%s: the file ends too early, it was probably cut off",
                        in->path);
    return s;
}

sdm_status sdm_stream_skip(sdm_stream *in, uint64_t size, sdm_error *err)
{
    uint8_t block[4096];
    sdm_status s = SDM_OK;
    while (size > 0 && !s) {
        const size_t n = size < sizeof block ? (size_t)size : sizeof block;
        s = sdm_stream_read(in, block, n, err);
        size -= n;
    }
    return s;
}

sdm_status sdm_stream_skip_to_tail(sdm_stream *in, uint64_t size, sdm_error *err)
{
    const uint64_t rest = in->left + (uint64_t)(in->end - in->at);
    return rest > size ? sdm_stream_skip(in, rest - size, err) : SDM_OK;
}

sdm_status sdm_stream_line(sdm_stream *in, bool *more, sdm_error *err)
{
    size_t n = 0;
    *more = false;
    for (;;) {
        const sdm_status s = fill_buffer(in, err);
        if (s) return s;
        if (in->at == in->end) break;
        const char c = (char)*in->at++;
        if (!*more) in->lines++;
        *more = true;
        if (c == '\n') break;
        if (n + 1 == sizeof in->line || c == '\0')
            return sdm_fail(
                err, SDM_E_FORMAT, "%s:%zu: %s: this is no header of an image", in->path, in->lines,
                c == '\0' ? "a zero byte in a line of text" : "a line of more than 65535 bytes");
        in->line[n++] = c;
    }
    if (n > 0 && in->line[n - 1] == '\r') n--;
    in->line[n] = '\0';
    return SDM_OK;
}

sdm_status sdm_stream_expect(const sdm_stream *in, uint64_t size, sdm_error *err)
{
    const uint64_t rest = in->left + (uint64_t)(in->end - in->at);
    if (in->zip && size / DEFLATE_RATIO > rest)
        return sdm_fail(
            err, SDM_E_FORMAT,
            "%s: the header declares %llu bytes of voxels, %llu compressed bytes cannot hold them",
            in->path, (unsigned long long)size, (unsigned long long)rest);
    if (!in->zip && size != rest)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: the header declares %llu bytes of voxels, the file has %llu", in->path,
                        (unsigned long long)size, (unsigned long long)rest);
    return SDM_OK;
}

sdm_status sdm_stream_end(sdm_stream *in, sdm_error *err)
{
    uint8_t byte;
    size_t taken;
    const sdm_status s = read_some(in, &byte, 1, &taken, err);
    if (!s && taken > 0)
        return sdm_fail(err, SDM_E_FORMAT, "%s: more bytes of voxels than the header declares",
                        in->path);
    return s;
}
