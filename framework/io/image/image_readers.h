/* Shared by the image readers: the common form of a header, and one read function for each format.
 */
#pragma once

#include "bytes.h"
#include "scan.h"
#include "stream.h"
#include "voxels.h"

/* Geometry and storage of the voxels, in the same form for every format. */
typedef struct sdm_image_header {
    int64_t n[3];
    /* row-major; column a is the vector from a voxel to the next along axis a, LPS, mm */
    double step[9];
    /* centre of voxel (0, 0, 0), LPS, mm */
    double origin[3];
    sdm_voxel_type type;
    /* true: the voxels are big-endian */
    bool big;
    /* value = slope * stored value + intercept */
    double slope, intercept;
    /* true: the voxels are the last bytes of the file, instead of those that follow the header */
    bool tail;
    /* The file holds `run` voxels of layer 0, then of layer 1 ..., then the next `run` voxels of
     * layer 0. run = 0: a whole layer at a time. */
    size_t layers, run;
} sdm_image_header;

/* Read a header into *h, which has its defaults, and text, segments and `placed` into *v, which is
   zero-initialised. The stream is left at the first voxel, with decompression switched on where
   needed. SDM_E_FORMAT, SDM_E_UNSUPPORTED, SDM_E_IO, SDM_E_NOMEM. */
sdm_status sdm_nifti_read(sdm_stream *in, sdm_image_header *h, sdm_volume *v, sdm_error *err);
sdm_status sdm_nrrd_read(sdm_stream *in, sdm_image_header *h, sdm_volume *v, sdm_error *err);
sdm_status sdm_metaimage_read(sdm_stream *in, sdm_image_header *h, sdm_volume *v, sdm_error *err);

/* The grid of a header, with orthonormal axis directions. SDM_E_UNSUPPORTED when the axes are
 * sheared by more than a tenth of a voxel at a corner; SDM_E_FORMAT when the numbers are not a
 * valid grid. */
sdm_status sdm_frame_grid(const sdm_image_header *h, sdm_grid *out, sdm_error *err);

/* Segments of a NRRD file. sdm_segments_take() reads one line "key:=value" and ignores keys that
 * are not about segments; sdm_segments_finish() is called after the last line and checks the
 * layers. */
sdm_status sdm_segments_take(sdm_volume *v, const sdm_stream *in, const char *key,
                             const char *value, sdm_error *err);
sdm_status sdm_segments_finish(sdm_volume *v, const sdm_stream *in, size_t layers, sdm_error *err);
