/* Reads and writes images of every voxel type: CT volumes, label maps and segmentations. All
 * lengths are mm, all coordinates LPS; x is the fastest index. */
#ifndef SDM_VOLUME_H
#define SDM_VOLUME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How a file stores a voxel. The numbers never change. */
typedef enum sdm_voxel_type {
    SDM_VOXEL_UINT8 = 0,
    SDM_VOXEL_INT8 = 1,
    SDM_VOXEL_UINT16 = 2,
    SDM_VOXEL_INT16 = 3,
    SDM_VOXEL_UINT32 = 4,
    SDM_VOXEL_INT32 = 5,
    SDM_VOXEL_UINT64 = 6,
    SDM_VOXEL_INT64 = 7,
    SDM_VOXEL_FLOAT32 = 8,
    SDM_VOXEL_FLOAT64 = 9
} sdm_voxel_type;

/* The number of bytes of a voxel, and the name of its type, "uint8" ... "float64"; 0 and "unknown"
   for a value that is no type. */
SDM_API size_t sdm_voxel_size(sdm_voxel_type type);
SDM_API const char *sdm_voxel_name(sdm_voxel_type type);

/* One segment of a 3D Slicer segmentation (.seg.nrrd): the voxels of `layer` that are equal to
 * `value`. */
typedef struct sdm_segment {
    /* SegmentN_Name and SegmentN_ID, UTF-8, cut to fit */
    char name[96];
    char id[96];
    /* SegmentN_LabelValue; 1 when the file has none */
    int64_t value;
    /* SegmentN_Layer, less than n_layers; the number N of the segment when the file has none */
    size_t layer;
} sdm_segment;

/* An image in memory. Zero-initialise; sdm_volume_dispose() frees. */
typedef struct sdm_volume {
    /* has passed sdm_grid_check(); the axis directions are orthonormal, a reflection is kept */
    sdm_grid grid;
    /* false: the file has no complete frame, and the default of its format is assumed */
    bool placed;
    /* true: the voxels were compressed, and the checksum of gzip or zlib is right */
    bool checked;
    /* number of layers: 1, or more for a segmentation with overlapping segments */
    size_t n_layers;
    /* [n_layers][nz][ny][nx]; slope and intercept of the file are applied in double, then rounded
     * to float: integers beyond 2^24 and float64 lose digits */
    float *values;
    /* the type in the file */
    sdm_voxel_type stored;
    /* range of the finite values; both 0 when there are none */
    float min, max;
    /* number of values that are NaN or infinite; they are kept in `values` */
    size_t n_nan, n_inf;
    /* [n_segments], in the order of the file; NULL when there are none */
    sdm_segment *segments;
    size_t n_segments;
    /* the one-line description in the file, "" when it has none */
    char text[256];
    /* NIfTI files with two frames, sform and qform: largest distance (mm) between the two places of
     * a voxel; 0: they agree to rounding, or there is one. sform is in use */
    double frames_differ_mm;
    /* true: one of the two frames is a mirror image of the other */
    bool frames_mirrored;
    /* true: the file is a header, and the voxels are in a second file */
    bool detached;
} sdm_volume;

/* Reads one three-dimensional image of one channel, in either byte order. The ending of `path`
   selects the format: .nii and .nii.gz (NIfTI-1 and NIfTI-2; the frame from sform, else qform, else
   the voxel sizes alone), .nrrd, .seg.nrrd and .nhdr (NRRD, raw or gzip, space LPS, RAS or LAS),
   .mha and .mhd (MetaImage, raw or zlib). A separate file of voxels must be in the folder of its
   header.

   Axis directions are replaced by the nearest orthonormal ones (the polar factor, Higham 1986) when
   that moves no voxel by more than a tenth of a voxel; otherwise the image is refused as sheared.
   Further axes of a NIfTI file must have length 1 and are dropped. The axis of a four-dimensional
   NRRD file that has no direction counts the layers of a segmentation, if the file has segments.
   Other files of several images are refused.

   Memory for the voxels is allocated only after their size has been compared with the length of the
   file (for compressed data with the largest size that it can expand to); a file with more or fewer
   bytes than its header declares is refused. An image that *out holds is freed first; on error *out
   is empty. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM; SDM_E_FORMAT: damaged; SDM_E_UNSUPPORTED: valid, but
   not supported. [any thread] */
SDM_API sdm_status sdm_volume_read(const char *path, sdm_volume *out, sdm_error *err);

/* Frees the image; *v is then zero-initialised. */
SDM_API void sdm_volume_dispose(sdm_volume *v);

/* True when `path` has an ending that sdm_volume_read() supports; false for NULL. */
SDM_API bool sdm_volume_knows(const char *path);

/* Finds the segment with this name, or else with this id. *out belongs to the volume. SDM_E_ARG
 * when there is none; the message lists the segments. */
SDM_API sdm_status sdm_volume_find_segment(const sdm_volume *v, const char *name,
                                           const sdm_segment **out, sdm_error *err);

/* Writes values[nz][ny][nx] of the C type of `type` (int16_t for SDM_VOXEL_INT16 ...), unscaled.
   The ending of `path` selects the format: .nii and .nii.gz (converted to RAS), .nrrd (gzip, LPS),
   .mha (LPS). `text` (may be NULL) is a one-line description. The file appears under its name only
   when it is complete. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM; SDM_E_UNSUPPORTED for another ending,
   listing the known ones, and for more than 32767 voxels along an axis in NIfTI. */
SDM_API sdm_status sdm_volume_write(const char *path, const sdm_grid *grid, const void *values,
                                    sdm_voxel_type type, const char *text, sdm_error *err);

/* Writes a 3D Slicer segmentation, whose name ends in .seg.nrrd: labels[nz][ny][nx], of which
   segment i of segments[n] are the voxels equal to its `value`, 1 to 255, with its name and id
   (without an id: the name), a colour and the code of tissue; `layer` is ignored. `text` (may be
   NULL) is a one-line description. The file appears under its name only when it is complete.
   SDM_E_ARG, also for a segment without a voxel; SDM_E_IO, SDM_E_NOMEM; SDM_E_UNSUPPORTED for
   another ending. */
SDM_API sdm_status sdm_segmentation_write(const char *path, const sdm_grid *grid,
                                          const uint8_t *labels, const sdm_segment *segments,
                                          size_t n, const char *text, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
