/* Reads an image file from front to back, with or without decompression. */
#pragma once

#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <zlib.h>

#include "sdm/status.h"

#define SDM_LINE_MAX 65536

/* An open file. About 100 kB: allocate it on the heap. */
typedef struct sdm_stream {
    /* name of the file, for messages */
    char path[4096];
    FILE *file;
    /* bytes of the file that are not in the buffer yet */
    uint64_t left;
    /* the unread part of the buffer */
    const uint8_t *at, *end;
    z_stream z;
    /* zip: the data are compressed; ended: all data have been read; detached: sdm_stream_detach()
     * opened this file */
    bool zip, ended, detached;
    uint8_t bytes[1 << 15];
    /* the line that was read last */
    char line[SDM_LINE_MAX];
    /* number of lines read */
    size_t lines;
} sdm_stream;

/* Opens a regular file. Call sdm_stream_close() in every case, also after an error. SDM_E_IO;
   SDM_E_ARG when the name is too long. */
sdm_status sdm_stream_open(sdm_stream *in, const char *path, sdm_error *err);
void sdm_stream_close(sdm_stream *in);

/* Closes the header and opens `name`, the file of its voxels, in the same folder. SDM_E_UNSUPPORTED
 * for a name that leads out of the folder, also by a symbolic link. */
sdm_status sdm_stream_detach(sdm_stream *in, const char *name, sdm_error *err);

/* Switches decompression on: from the next byte to its end, the file is gzip (RFC 1952) or zlib
 * (RFC 1950) data. SDM_E_NOMEM. */
sdm_status sdm_stream_unzip(sdm_stream *in, sdm_error *err);

/* True when the next two bytes, which stay unread, are the magic number of gzip. */
bool sdm_stream_is_gzip(sdm_stream *in);

/* Read or skip exactly `size` bytes. SDM_E_FORMAT: the data are damaged or end too early;
 * SDM_E_IO. */
sdm_status sdm_stream_read(sdm_stream *in, void *out, size_t size, sdm_error *err);
sdm_status sdm_stream_skip(sdm_stream *in, uint64_t size, sdm_error *err);
/* Moves to the last `size` bytes of an uncompressed file; does nothing when fewer are left. */
sdm_status sdm_stream_skip_to_tail(sdm_stream *in, uint64_t size, sdm_error *err);

/* Reads the next line into in->line, without its line end; *more is false at the end of the file.
 * SDM_E_FORMAT for a zero byte in the line or more than 65535 bytes. */
sdm_status sdm_stream_line(sdm_stream *in, bool *more, sdm_error *err);

/* SDM_E_FORMAT unless the rest of the file is `size` bytes long or, when compressed, long enough to
 * expand to `size` bytes. */
sdm_status sdm_stream_expect(const sdm_stream *in, uint64_t size, sdm_error *err);

/* SDM_E_FORMAT unless all data have been read and the checksum of compressed data is right. */
sdm_status sdm_stream_end(sdm_stream *in, sdm_error *err);
