/* Images of every voxel type on disk: CT volumes, label maps and segmentations, read and written.
 * Everywhere: mm, frame LPS, x fastest. */
#ifndef SDM_VOLUME_H
#define SDM_VOLUME_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* How a file stores a voxel. Values are pinned. */
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

/* Bytes of one voxel, and "uint8" ... "float64"; 0 and "unknown" for another value. */
SDM_API size_t sdm_voxel_size(sdm_voxel_type type);
SDM_API const char *sdm_voxel_name(sdm_voxel_type type);

/* One segment of a 3D Slicer segmentation (.seg.nrrd): the voxels of `layer` that are equal to
 * `value`. */
typedef struct sdm_segment {
    char name[96]; /* as the user called it, UTF-8, cut to fit */
    char id[96];
    int64_t value; /* LabelValue; 1 where the file states none */
    size_t layer;  /* below n_layers; without a stated one the place in the list of segments */
} sdm_segment;

/* An image in memory. Zero-initialise; sdm_volume_dispose() frees. */
typedef struct sdm_volume {
    sdm_grid grid;   /* has passed sdm_grid_check(); directions orthonormal, a reflection is kept */
    bool placed;     /* false: the file names no frame; its axes are taken as those of its format's
                        default */
    bool checked;    /* the voxels were compressed, and the checksum of gzip or zlib is right */
    size_t n_layers; /* 1, or more for a segmentation whose segments overlap */
    float *values;   /* [n_layers][nz][ny][nx], slope and intercept of the file applied in double,
                        then rounded to   float: integers beyond 2^24 and float64 lose digits */
    sdm_voxel_type stored; /* the type in the file */
    float min, max;        /* of the finite values; both 0 when there are none */
    size_t n_nan, n_inf;   /* values that are NaN or infinite: they are kept, the caller decides */
    sdm_segment *segments; /* [n_segments], in the order of the file; NULL when there are none */
    size_t n_segments;
    char text[256]; /* the file's one-line description, "" without one */
} sdm_volume;

/* Reads one three-dimensional image of one channel; the type follows the name: .nii .nii.gz
   (NIfTI-1 and -2; sform, else qform, else voxel sizes alone), .nrrd .seg.nrrd .nhdr (raw or gzip;
   space LPS, RAS or LAS), .mha .mhd (raw or zlib). Both byte orders. The data of a detached header
   are read from its own folder only. Directions whose voxels lie within a tenth of a voxel of an
   orthonormal grid are made orthonormal (the polar factor, Higham 1986), sheared ones are refused.
   Further axes of a NIfTI file are dropped when their length is 1. A fourth axis of a NRRD file,
   one without a direction, gives the layers of a segmentation when the file names segments. Other
   files of several images are refused. Nothing is allocated before the size has been compared with
   the length of the file (of gzip: with what it can hold); a file of more or fewer bytes than its
   header declares is refused. A volume that held an image before is disposed of first; on error it
   is left empty. SDM_E_ARG, SDM_E_IO; SDM_E_FORMAT: damaged; SDM_E_UNSUPPORTED: valid, but not read
   here; SDM_E_NOMEM. Thread safe. */
SDM_API sdm_status sdm_volume_read(const char *path, sdm_volume *out, sdm_error *err);
SDM_API void sdm_volume_dispose(sdm_volume *v);

/* True when the name ends like one that sdm_volume_read() knows. */
SDM_API bool sdm_volume_knows(const char *path);

/* The segment of this name, or else of this id. SDM_E_ARG lists the segments there are. *out
 * belongs to the volume. */
SDM_API sdm_status sdm_volume_find_segment(const sdm_volume *v, const char *name,
                                           const sdm_segment **out, sdm_error *err);

/* Writes values[nz][ny][nx] of the C type that `type` names (int16_t for SDM_VOXEL_INT16 ...)
   atomically and unscaled; the format follows the name: .nii .nii.gz (RAS, converted), .nrrd
   (gzip), .mha. `text` (may be NULL) is a one-line description. SDM_E_UNSUPPORTED for another name,
   listing those known, and for sizes NIfTI-1 cannot state. */
SDM_API sdm_status sdm_volume_write(const char *path, const sdm_grid *grid, const void *values,
                                    sdm_voxel_type type, const char *text, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
