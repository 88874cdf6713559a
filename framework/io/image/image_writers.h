/* Shared by the image writers: an output stream with optional gzip compression, and one write
 * function for each format. */
#pragma once

#include <zlib.h>

#include "bytes.h"
#include "voxels.h"

/* A stream of bytes into an open file. Call sdm_sink_finish() before the file is committed, and
 * sdm_sink_free() in every case, also after an error. */
typedef struct sdm_sink {
    sdm_outfile *file;
    z_stream z;
    /* true: the bytes are compressed with gzip */
    bool zip;
    /* compressed bytes on their way to the file */
    uint8_t out[1 << 15];
} sdm_sink;

/* Initialises *sink, which borrows `file`. SDM_E_NOMEM. */
sdm_status sdm_sink_open(sdm_sink *sink, sdm_outfile *file, bool zip, sdm_error *err);
sdm_status sdm_sink_write(sdm_sink *sink, const void *data, size_t size, sdm_error *err);
/* Writes values[count] of the C type of `type`, little endian. */
sdm_status sdm_sink_voxels(sdm_sink *sink, const void *values, sdm_voxel_type type, size_t count,
                           sdm_error *err);
/* Writes the bytes that the compressor still holds back. */
sdm_status sdm_sink_finish(sdm_sink *sink, sdm_error *err);
void sdm_sink_free(sdm_sink *sink);

/* Copies at most size - 1 bytes of text into out[size]: control characters, line ends included,
 * become spaces; a UTF-8 character is never cut in two. */
void sdm_one_line(const char *text, char *out, size_t size);

/* An image to write. */
typedef struct sdm_image {
    /* has passed sdm_grid_check() */
    const sdm_grid *grid;
    /* [nz][ny][nx], of the C type of `type` */
    const void *values;
    sdm_voxel_type type;
    /* description; never NULL */
    const char *text;
    /* NRRD: further lines of the header, each with its line feed; NULL: none */
    const char *keys;
} sdm_image;

/* Write header and voxels into an open file, which the caller commits. sdm_nifti_write():
 * SDM_E_UNSUPPORTED for more than 32767 voxels along an axis. */
sdm_status sdm_nifti_write(sdm_outfile *f, bool zip, const sdm_image *m, sdm_error *err);
sdm_status sdm_nrrd_write(sdm_outfile *f, const sdm_image *m, sdm_error *err);
sdm_status sdm_metaimage_write(sdm_outfile *f, const sdm_image *m, sdm_error *err);
