/* An image file read from front to back, with or without inflate. */
#ifndef SDM_IO_STREAM_H
#define SDM_IO_STREAM_H

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <zlib.h>

#include "sdm/status.h"

#define SDM_LINE_MAX 65536

/* A regular file from front to back, from some byte on through inflate. Large: on the heap. */
typedef struct sdm_stream {
    char path[4096];
    FILE *file;
    uint64_t left;           /* bytes of the file behind `end` */
    const uint8_t *at, *end; /* fetched, not used yet */
    z_stream z;
    bool zip, ended; /* ended: no byte of the data is left */
    uint8_t bytes[1 << 15];
    char line[SDM_LINE_MAX];
    size_t lines; /* read so far */
} sdm_stream;

/* sdm_stream_close() always. */
sdm_status sdm_stream_open(sdm_stream *s, const char *path, sdm_error *err);
void sdm_stream_close(sdm_stream *s);

/* Goes on in another file, that of the voxels, in the folder of the header. SDM_E_UNSUPPORTED for a
 * name that leaves it. */
sdm_status sdm_stream_detach(sdm_stream *s, const char *name, sdm_error *err);

/* The next byte is that of gzip (RFC 1952) or zlib (RFC 1950) data, which reach to the end of the
 * file. */
sdm_status sdm_stream_unzip(sdm_stream *s, sdm_error *err);

/* Without using it: true when the file begins like gzip. */
bool sdm_stream_is_gzip(sdm_stream *s);

/* Exactly `size` bytes; SDM_E_FORMAT when the file ends before, or is damaged. */
sdm_status sdm_stream_read(sdm_stream *s, void *out, size_t size, sdm_error *err);
sdm_status sdm_stream_skip(sdm_stream *s, uint64_t size, sdm_error *err);
/* Leaves the last `size` bytes of a file that is not compressed, or all of them when it has fewer.
 */
sdm_status sdm_stream_skip_to_tail(sdm_stream *s, uint64_t size, sdm_error *err);

/* The next line in s->line, without its end; *more is false at the end of the file. */
sdm_status sdm_stream_line(sdm_stream *s, bool *more, sdm_error *err);

/* SDM_E_FORMAT unless the rest of the file is `size` bytes, or compressed and long enough to become
 * `size` bytes. */
sdm_status sdm_stream_expect(const sdm_stream *s, uint64_t size, sdm_error *err);

/* SDM_E_FORMAT unless everything was read; checks the checksum of compressed data. */
sdm_status sdm_stream_end(sdm_stream *s, sdm_error *err);

#endif
