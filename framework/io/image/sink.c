/* Bytes on their way to a file, with or without gzip (RFC 1952, no time stamp: the same bytes for
 * the same values). */
#include "imageparts.h"

#define GZIP_WINDOW (15 + 16) /* zlib: 32 KiB window, gzip wrapper */

sdm_status sdm_sink_open(sdm_sink *s, sdm_outfile *file, bool zip, sdm_error *err)
{
    memset(s, 0, sizeof *s);
    s->file = file;
    if (!zip) return SDM_OK;
    if (deflateInit2(&s->z, 6, Z_DEFLATED, GZIP_WINDOW, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        return sdm_fail(err, SDM_E_NOMEM, "no memory for the compression of an image");
    s->zip = true;
    return SDM_OK;
}

/* Feeds zlib until it has taken all input (and, at the end, given all output). */
static sdm_status pump(sdm_sink *s, int flush, sdm_error *err)
{
    int state;
    do {
        s->z.next_out = s->out;
        s->z.avail_out = sizeof s->out;
        state = deflate(&s->z, flush);
        if (state == Z_STREAM_ERROR)
            return sdm_fail(err, SDM_E_INTERNAL, "zlib refused to compress an image");
        const sdm_status e =
            sdm_outfile_write(s->file, s->out, sizeof s->out - s->z.avail_out, err);
        if (e) return e;
    } while (s->z.avail_out == 0 || (flush == Z_FINISH && state != Z_STREAM_END));
    return SDM_OK;
}

sdm_status sdm_sink_write(sdm_sink *s, const void *data, size_t size, sdm_error *err)
{
    if (!s->zip) return sdm_outfile_write(s->file, data, size, err);
    const uint8_t *p = data;
    while (size > 0) {
        const size_t part = size < (1u << 30) ? size : 1u << 30; /* zlib counts in unsigned int */
        s->z.next_in = (z_const Bytef *)p;
        s->z.avail_in = (uInt)part;
        const sdm_status e = pump(s, Z_NO_FLUSH, err);
        if (e) return e;
        p += part;
        size -= part;
    }
    return SDM_OK;
}

sdm_status sdm_sink_voxels(sdm_sink *s, const void *values, sdm_voxel_type type, size_t count,
                           sdm_error *err)
{
    uint8_t block[8192];
    const size_t size = sdm_voxel_size(type), most = sizeof block / size;
    for (size_t i = 0; i < count;) {
        const size_t n = count - i < most ? count - i : most;
        sdm_voxels_encode(values, type, i, n, block);
        const sdm_status e = sdm_sink_write(s, block, n * size, err);
        if (e) return e;
        i += n;
    }
    return SDM_OK;
}

sdm_status sdm_sink_finish(sdm_sink *s, sdm_error *err)
{
    if (!s->zip) return SDM_OK;
    s->z.next_in = NULL;
    s->z.avail_in = 0;
    return pump(s, Z_FINISH, err);
}

void sdm_sink_free(sdm_sink *s)
{
    if (s->zip) deflateEnd(&s->z);
    s->zip = false;
}

void sdm_one_line(const char *text, char *out, size_t size)
{
    size_t n = 0;
    for (; text[n] != '\0' && n + 1 < size; n++)
        out[n] = (unsigned char)text[n] < ' ' || text[n] == 127 ? ' ' : text[n];
    if (text[n] != '\0')
        while (n > 0 && ((unsigned char)text[n] & 0xC0) == 0x80) n--;
    out[n] = '\0';
}
