/* Bytes of an image file from front to back, with or without inflate. */
#include "stream.h"

#include <errno.h>
#include <string.h>
#include <sys/stat.h>

#define ANY_WINDOW (15 + 32) /* zlib: 32 KiB window, gzip or zlib wrapper */
#define DEFLATE_RATIO                                                                              \
    1032 /* deflate makes at most so many bytes of one (zlib's technical notes)                    \
          */
#define PART_MAX ((size_t)1 << 30) /* zlib counts in unsigned int */

sdm_status sdm_stream_open(sdm_stream *s, const char *path, sdm_error *err)
{
    memset(s, 0, sizeof *s);
    const size_t n = strlen(path);
    if (n >= sizeof s->path)
        return sdm_fail(err, SDM_E_ARG, "%.80s...: the name of the file is too long", path);
    memcpy(s->path, path, n);
    struct stat st;
    if (stat(path, &st))
        return sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", path, strerror(errno));
    if (!S_ISREG(st.st_mode)) return sdm_fail(err, SDM_E_IO, "%s: not a regular file", path);
    s->file = fopen(path, "rb");
    if (!s->file) return sdm_fail(err, SDM_E_IO, "%s: cannot open: %s", path, strerror(errno));
    s->left = (uint64_t)st.st_size;
    s->at = s->end = s->bytes;
    return SDM_OK;
}

void sdm_stream_close(sdm_stream *s)
{
    if (s->zip) inflateEnd(&s->z);
    if (s->file) fclose(s->file);
    s->zip = false;
    s->file = NULL;
}

sdm_status sdm_stream_detach(sdm_stream *s, const char *name, sdm_error *err)
{
    char path[sizeof s->path];
    if (name[0] == '.' && name[1] == '/') name += 2;
    if (!*name || strpbrk(name, "/\\:") || !strcmp(name, ".") || !strcmp(name, ".."))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "%s: its voxels are in '%.200s': a file of another folder is not opened, "
                        "put it beside the header and "
                        "name it there without a folder",
                        s->path, name);
    const char *slash = strrchr(s->path, '/');
    const int folder = slash ? (int)(slash + 1 - s->path) : 0;
    const int n = snprintf(path, sizeof path, "%.*s%s", folder, s->path, name);
    if (n < 0 || (size_t)n >= sizeof path)
        return sdm_fail(err, SDM_E_FORMAT, "%s: the name of the file of its voxels is too long",
                        s->path);
    char header[sizeof s->path];
    memcpy(header, s->path, sizeof header);
    sdm_stream_close(s);
    const sdm_status e = sdm_stream_open(s, path, err);
    return e ? sdm_fail_in(err, e, "%s", header) : SDM_OK;
}

/* Fetches so that two bytes are there, or all that the file still has. */
static sdm_status fetch(sdm_stream *s, sdm_error *err)
{
    const size_t kept = (size_t)(s->end - s->at), room = sizeof s->bytes - kept;
    if (kept >= 2 || s->left == 0) return SDM_OK;
    const size_t want = s->left < room ? (size_t)s->left : room;
    if (kept > 0) s->bytes[0] = *s->at;
    const size_t got = fread(s->bytes + kept, 1, want, s->file);
    if (got < want && ferror(s->file))
        return sdm_fail(err, SDM_E_IO, "%s: cannot read: %s", s->path, strerror(errno));
    if (got < want) return sdm_fail(err, SDM_E_IO, "%s: became shorter while it was read", s->path);
    s->at = s->bytes;
    s->end = s->bytes + kept + got;
    s->left -= got;
    return SDM_OK;
}

bool sdm_stream_is_gzip(sdm_stream *s)
{
    return !fetch(s, NULL) && s->end - s->at >= 2 && s->at[0] == 0x1F && s->at[1] == 0x8B;
}

sdm_status sdm_stream_unzip(sdm_stream *s, sdm_error *err)
{
    if (inflateInit2(&s->z, ANY_WINDOW) != Z_OK)
        return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for its decompression", s->path);
    s->zip = true;
    return SDM_OK;
}

/* One call of inflate. */
static sdm_status inflate_part(sdm_stream *s, uint8_t *out, size_t size, size_t *got,
                               sdm_error *err)
{
    const size_t n = (size_t)(s->end - s->at);
    if (n == 0) return sdm_fail(err, SDM_E_FORMAT, "%s: the compressed data are cut off", s->path);
    s->z.next_in = (z_const Bytef *)s->at;
    s->z.avail_in = (uInt)n;
    s->z.next_out = out;
    s->z.avail_out = (uInt)(size < PART_MAX ? size : PART_MAX);
    const uInt room = s->z.avail_out;
    const int state = inflate(&s->z, Z_NO_FLUSH);
    s->at = s->end - s->z.avail_in;
    *got = room - s->z.avail_out;
    if (state == Z_MEM_ERROR)
        return sdm_fail(err, SDM_E_NOMEM, "%s: no memory for its decompression", s->path);
    if (state == Z_OK || state == Z_BUF_ERROR) return SDM_OK;
    if (state != Z_STREAM_END)
        return sdm_fail(err, SDM_E_FORMAT, "%s: the compressed data are damaged (%s)", s->path,
                        s->z.msg ? s->z.msg : "a dictionary is missing");
    const sdm_status e = fetch(s, err);
    s->ended = !e && s->at == s->end;
    /* gzip files may be several joined, as bgzip writes them */
    if (!e && !s->ended && (!sdm_stream_is_gzip(s) || inflateReset(&s->z) != Z_OK))
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: bytes that belong to nothing follow the compressed data", s->path);
    return e;
}

/* Up to `size` bytes; fewer only at the end of the data. */
static sdm_status take(sdm_stream *s, uint8_t *out, size_t size, size_t *taken, sdm_error *err)
{
    sdm_status e = SDM_OK;
    *taken = 0;
    while (*taken < size && !s->ended && !e) {
        size_t n = 0;
        e = fetch(s, err);
        if (!e && s->zip) {
            e = inflate_part(s, out + *taken, size - *taken, &n, err);
        } else if (!e) {
            n = (size_t)(s->end - s->at);
            s->ended = n == 0;
            if (n > size - *taken) n = size - *taken;
            memcpy(out + *taken, s->at, n);
            s->at += n;
        }
        *taken += n;
    }
    return e;
}

sdm_status sdm_stream_read(sdm_stream *s, void *out, size_t size, sdm_error *err)
{
    size_t taken;
    const sdm_status e = take(s, out, size, &taken, err);
    if (!e && taken < size)
        return sdm_fail(err, SDM_E_FORMAT, "%s: the file ends too early, it was probably cut off",
                        s->path);
    return e;
}

sdm_status sdm_stream_skip(sdm_stream *s, uint64_t size, sdm_error *err)
{
    uint8_t block[4096];
    sdm_status e = SDM_OK;
    while (size > 0 && !e) {
        const size_t n = size < sizeof block ? (size_t)size : sizeof block;
        e = sdm_stream_read(s, block, n, err);
        size -= n;
    }
    return e;
}

sdm_status sdm_stream_skip_to_tail(sdm_stream *s, uint64_t size, sdm_error *err)
{
    const uint64_t rest = s->left + (uint64_t)(s->end - s->at);
    return rest > size ? sdm_stream_skip(s, rest - size, err) : SDM_OK;
}

sdm_status sdm_stream_line(sdm_stream *s, bool *more, sdm_error *err)
{
    size_t n = 0;
    *more = false;
    for (;;) {
        const sdm_status e = fetch(s, err);
        if (e) return e;
        if (s->at == s->end) break;
        const char c = (char)*s->at++;
        if (!*more) s->lines++;
        *more = true;
        if (c == '\n') break;
        if (n + 1 == sizeof s->line || c == '\0')
            return sdm_fail(
                err, SDM_E_FORMAT, "%s:%zu: %s: this is no header of an image", s->path, s->lines,
                c == '\0' ? "a zero byte in a line of text" : "a line of more than 65535 bytes");
        s->line[n++] = c;
    }
    if (n > 0 && s->line[n - 1] == '\r') n--;
    s->line[n] = '\0';
    return SDM_OK;
}

sdm_status sdm_stream_expect(const sdm_stream *s, uint64_t size, sdm_error *err)
{
    const uint64_t rest = s->left + (uint64_t)(s->end - s->at);
    if (s->zip && size / DEFLATE_RATIO > rest)
        return sdm_fail(
            err, SDM_E_FORMAT,
            "%s: the header declares %llu bytes of voxels, %llu compressed bytes cannot hold them",
            s->path, (unsigned long long)size, (unsigned long long)rest);
    if (!s->zip && size != rest)
        return sdm_fail(err, SDM_E_FORMAT,
                        "%s: the header declares %llu bytes of voxels, the file has %llu", s->path,
                        (unsigned long long)size, (unsigned long long)rest);
    return SDM_OK;
}

sdm_status sdm_stream_end(sdm_stream *s, sdm_error *err)
{
    uint8_t byte;
    size_t taken;
    const sdm_status e = take(s, &byte, 1, &taken, err);
    if (!e && taken > 0)
        return sdm_fail(err, SDM_E_FORMAT, "%s: more bytes of voxels than the header declares",
                        s->path);
    return e;
}
