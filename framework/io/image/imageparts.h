/* Inside of the image writers: a stream of bytes that may be compressed on its way to the file. */
#ifndef SDM_IO_IMAGEPARTS_H
#define SDM_IO_IMAGEPARTS_H

#include <zlib.h>

#include "bytes.h"
#include "voxels.h"

/* Bytes for an open file, through gzip when `zip`. sdm_sink_free() always, sdm_sink_finish() before
 * the file is committed. */
typedef struct sdm_sink {
    sdm_outfile *file;
    z_stream z;
    bool zip;
    uint8_t out[1 << 15];
} sdm_sink;

/* In place, since it is large; `zip` as wanted from the first byte on. */
sdm_status sdm_sink_open(sdm_sink *s, sdm_outfile *file, bool zip, sdm_error *err);
sdm_status sdm_sink_write(sdm_sink *s, const void *data, size_t size, sdm_error *err);
sdm_status sdm_sink_voxels(sdm_sink *s, const void *values, sdm_voxel_type type, size_t count,
                           sdm_error *err);
sdm_status sdm_sink_finish(sdm_sink *s, sdm_error *err);
void sdm_sink_free(sdm_sink *s);

/* One line of at most size - 1 bytes: control characters become spaces, a cut does not split a
 * UTF-8 character. */
void sdm_one_line(const char *text, char *out, size_t size);

/* An image to be written: values[nz][ny][nx] of the C type of `type`; the grid has been checked,
 * `text` is never NULL. */
typedef struct sdm_image {
    const sdm_grid *grid;
    const void *values;
    sdm_voxel_type type;
    const char *text;
} sdm_image;

/* Writers for an open file. */
sdm_status sdm_nifti_write(sdm_outfile *f, bool zip, const sdm_image *m, sdm_error *err);
sdm_status sdm_nrrd_write(sdm_outfile *f, const sdm_image *m, sdm_error *err);
sdm_status sdm_metaimage_write(sdm_outfile *f, const sdm_image *m, sdm_error *err);

#endif
