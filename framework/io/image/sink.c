/* The output stream of the image writers, with or without gzip (RFC 1952). The gzip header has no
 * time stamp, so the same values give the same bytes. */
#include "image_writers.h"

#define GZIP_WINDOW (15 + 16) /* zlib: 32 KiB window, gzip wrapper */

sdm_status sdm_sink_open(sdm_sink *sink, sdm_outfile *file, bool zip, sdm_error *err)
{
    memset(sink, 0, sizeof *sink);
    sink->file = file;
    if (!zip) return SDM_OK;
    if (deflateInit2(&sink->z, 6, Z_DEFLATED, GZIP_WINDOW, 8, Z_DEFAULT_STRATEGY) != Z_OK)
        return sdm_fail(err, SDM_E_NOMEM, "no memory for the compression of an image");
    sink->zip = true;
    return SDM_OK;
}

/* Compresses all input of sink->z and writes what comes out; with Z_FINISH, also all that zlib
 * holds back. */
static sdm_status sink_deflate(sdm_sink *sink, int flush, sdm_error *err)
{
    int state;
    do {
        sink->z.next_out = sink->out;
        sink->z.avail_out = sizeof sink->out;
        state = deflate(&sink->z, flush);
        if (state == Z_STREAM_ERROR)
            return sdm_fail(err, SDM_E_INTERNAL, "zlib refused to compress an image");
        const sdm_status s =
            sdm_outfile_write(sink->file, sink->out, sizeof sink->out - sink->z.avail_out, err);
        if (s) return s;
    } while (sink->z.avail_out == 0 || (flush == Z_FINISH && state != Z_STREAM_END));
    return SDM_OK;
}

sdm_status sdm_sink_write(sdm_sink *sink, const void *data, size_t size, sdm_error *err)
{
    if (!sink->zip) return sdm_outfile_write(sink->file, data, size, err);
    const uint8_t *p = data;
    while (size > 0) {
        const size_t part = size < (1u << 30) ? size : 1u << 30; // zlib counts in unsigned int
        sink->z.next_in = (z_const Bytef *)p;
        sink->z.avail_in = (uInt)part;
        const sdm_status s = sink_deflate(sink, Z_NO_FLUSH, err);
        if (s) return s;
        p += part;
        size -= part;
    }
    return SDM_OK;
}

sdm_status sdm_sink_voxels(sdm_sink *sink, const void *values, sdm_voxel_type type, size_t count,
                           sdm_error *err)
{
    uint8_t block[8192];
    const size_t size = sdm_voxel_size(type), room = sizeof block / size;
    for (size_t i = 0; i < count;) {
        const size_t n = count - i < room ? count - i : room;
        sdm_voxels_encode(values, type, i, n, block);
        const sdm_status s = sdm_sink_write(sink, block, n * size, err);
        if (s) return s;
        i += n;
    }
    return SDM_OK;
}

sdm_status sdm_sink_finish(sdm_sink *sink, sdm_error *err)
{
    if (!sink->zip) return SDM_OK;
    sink->z.next_in = NULL;
    sink->z.avail_in = 0;
    return sink_deflate(sink, Z_FINISH, err);
}

void sdm_sink_free(sdm_sink *sink)
{
    if (sink->zip) deflateEnd(&sink->z);
    sink->zip = false;
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
