/* PNG files (ISO/IEC 15948), 8-bit RGB, each line with the filter that leaves the smallest
 * differences. */
#include "canvas.h"

#include <stdlib.h>
#include <string.h>
#include <zlib.h>

#include "sdm/internal/file.h"
#include "sdm/memory.h"

#define CHUNK 32768

static void put_big(uint8_t *p, uint32_t v)
{
    for (int i = 0; i < 4; i++) p[i] = (uint8_t)(v >> (24 - 8 * i));
}

static sdm_status write_chunk(sdm_outfile *f, const char *type, const uint8_t *data, size_t size,
                              sdm_error *err)
{
    uint8_t head[8], tail[4];
    put_big(head, (uint32_t)size);
    memcpy(head + 4, type, 4);
    uLong crc = crc32(0, head + 4, 4);
    if (size) crc = crc32(crc, data, (uInt)size);
    put_big(tail, (uint32_t)crc);
    sdm_status e = sdm_outfile_write(f, head, sizeof head, err);
    if (!e && size) e = sdm_outfile_write(f, data, size, err);
    return e ? e : sdm_outfile_write(f, tail, sizeof tail, err);
}

/* Paeth's predictor: the neighbour nearest to left + up - corner. */
static int paeth(int left, int up, int corner)
{
    const int p = left + up - corner, dl = abs(p - left), du = abs(p - up), dc = abs(p - corner);
    if (dl <= du && dl <= dc) return left;
    return du <= dc ? up : corner;
}

/* Filters one line; returns the sum of the absolute differences. */
static long filter_line(int filter, const uint8_t *line, const uint8_t *above, size_t size,
                        uint8_t *out)
{
    long sum = 0;
    out[0] = (uint8_t)filter;
    for (size_t i = 0; i < size; i++) {
        const int left = i >= 3 ? line[i - 3] : 0, up = above ? above[i] : 0,
                  corner = above && i >= 3 ? above[i - 3] : 0;
        const int guess[5] = {0, left, up, (left + up) / 2, paeth(left, up, corner)};
        out[i + 1] = (uint8_t)(line[i] - guess[filter]);
        sum += abs((int8_t)out[i + 1]);
    }
    return sum;
}

/* Compresses what z holds into IDAT chunks. */
static sdm_status pump(sdm_outfile *f, z_stream *z, uint8_t *block, int flush, sdm_error *err)
{
    for (;;) {
        const int state = deflate(z, flush);
        if (state == Z_STREAM_ERROR)
            return sdm_fail(err, SDM_E_INTERNAL, "zlib refused to compress a picture");
        const bool done = state == Z_STREAM_END;
        if (z->avail_out == 0 || done) {
            const sdm_status e = write_chunk(f, "IDAT", block, CHUNK - z->avail_out, err);
            if (e) return e;
            z->next_out = block;
            z->avail_out = CHUNK;
        } else if (flush != Z_FINISH) {
            return SDM_OK;
        }
        if (done) return SDM_OK;
    }
}

static sdm_status write_pixels(sdm_outfile *f, const sdm_canvas *c, z_stream *z, uint8_t *block,
                               uint8_t *lines, sdm_error *err)
{
    const size_t size = 3 * (size_t)c->w;
    z->next_out = block;
    z->avail_out = CHUNK;
    for (int y = 0; y < c->h; y++) {
        const uint8_t *line = c->rgb + (size_t)y * size;
        int best = 0;
        long least = 0;
        for (int filter = 0; filter < 5; filter++) {
            const long sum = filter_line(filter, line, y ? line - size : NULL, size,
                                         lines + (size_t)filter * (size + 1));
            if (filter && sum >= least) continue;
            least = sum;
            best = filter;
        }
        z->next_in = lines + (size_t)best * (size + 1);
        z->avail_in = (uInt)(size + 1);
        const sdm_status e = pump(f, z, block, Z_NO_FLUSH, err);
        if (e) return e;
    }
    return pump(f, z, block, Z_FINISH, err);
}

static sdm_status write_image(sdm_outfile *f, const sdm_canvas *c, sdm_error *err)
{
    uint8_t head[13] = {0}, *work = NULL;
    put_big(head, (uint32_t)c->w);
    put_big(head + 4, (uint32_t)c->h);
    head[8] = 8; /* bits */
    head[9] = 2; /* RGB */
    z_stream z = {0};
    sdm_status e = sdm_outfile_write(f, "\x89PNG\r\n\x1a\n", 8, err);
    if (!e) e = write_chunk(f, "IHDR", head, sizeof head, err);
    if (!e) e = SDM_ALLOC(&work, CHUNK + 5 * (3 * (size_t)c->w + 1), "lines of a picture", err);
    if (e) return e;
    if (deflateInit(&z, 6) == Z_OK) {
        e = write_pixels(f, c, &z, work, work + CHUNK, err);
        deflateEnd(&z);
    } else {
        e = sdm_fail(err, SDM_E_NOMEM, "no memory for the compression of a picture");
    }
    sdm_free(work);
    return e ? e : write_chunk(f, "IEND", NULL, 0, err);
}

sdm_status sdm_png_write(const char *path, const sdm_canvas *c, sdm_error *err)
{
    sdm_outfile *f = NULL;
    sdm_status e = sdm_outfile_open(path, &f, err);
    if (e) return e;
    e = write_image(f, c, err);
    if (!e) return sdm_outfile_commit(&f, err);
    sdm_outfile_discard(&f);
    return e;
}
