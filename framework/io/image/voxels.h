/* Voxel types: their bytes and what each image format calls them. */
#ifndef SDM_IO_VOXELS_H
#define SDM_IO_VOXELS_H

#include "sdm/volume.h"

#define SDM_N_VOXEL_TYPES 10

/* Lists of names are separated by '|'; the first one is written. */
typedef struct sdm_voxel_format {
    const char *name;
    size_t size;
    int nifti;        /* code of the datatype field */
    const char *nrrd; /* without "_t": "int16_t" is "int16" */
    const char *meta; /* without "MET_" */
} sdm_voxel_format;

extern const sdm_voxel_format sdm_voxel_formats[SDM_N_VOXEL_TYPES];

/* True when `word` is in the list, upper or lower case. */
bool sdm_is_listed(const char *word, const char *list);

/* out[n] = voxels of `type` in p, of either byte order, times slope plus intercept. */
void sdm_voxels_decode(const uint8_t *p, sdm_voxel_type type, bool big, double slope,
                       double intercept, size_t n, float *out);

/* p = n voxels of `type`, beginning with number `first` of the array `values`, little endian. */
void sdm_voxels_encode(const void *values, sdm_voxel_type type, size_t first, size_t n, uint8_t *p);

#endif
