/* Inside of the image readers: what the header of every format comes down to. */
#ifndef SDM_IO_VOLUMEPARTS_H
#define SDM_IO_VOLUMEPARTS_H

#include "bytes.h"
#include "scan.h"
#include "stream.h"
#include "voxels.h"

/* What a header says about the voxels behind it. */
typedef struct sdm_image_header {
    int64_t n[3];
    double step[9];   /* row-major; column a leads from a voxel to the next along axis a, LPS mm */
    double origin[3]; /* of voxel (0, 0, 0), LPS mm */
    sdm_voxel_type type;
    bool big; /* byte order */
    double slope, intercept;
    bool tail; /* the voxels are the last bytes of the file, not the next */
    /* file order: runs of `run` voxels of each layer in turn; one layer has one run */
    size_t layers, run;
} sdm_image_header;

/* Header readers: leave the stream at the first voxel, inflating where needed, and put what is
   beside the voxels (text, segments, placed) into the volume, which is zero-initialised. */
sdm_status sdm_nifti_read(sdm_stream *s, sdm_image_header *h, sdm_volume *v, sdm_error *err);
sdm_status sdm_nrrd_read(sdm_stream *s, sdm_image_header *h, sdm_volume *v, sdm_error *err);
sdm_status sdm_metaimage_read(sdm_stream *s, sdm_image_header *h, sdm_volume *v, sdm_error *err);

/* The grid of a header. SDM_E_UNSUPPORTED when its axes are sheared, SDM_E_FORMAT when its numbers
 * are not those of a grid. */
sdm_status sdm_frame_grid(const sdm_image_header *h, sdm_grid *out, sdm_error *err);

/* "mm", "um" ...: mm in one of it; 0 when it is not known. */
double sdm_length_unit(const char *name);

/* Segments: a line "key:=value" of the header, whatever its key; after the last line the check
 * against the layers. */
sdm_status sdm_segments_take(sdm_volume *v, const sdm_stream *s, const char *key, const char *value,
                             sdm_error *err);
sdm_status sdm_segments_finish(sdm_volume *v, const sdm_stream *s, size_t layers, sdm_error *err);

#endif
