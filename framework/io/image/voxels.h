/* Voxel types: their size and their name in each image format. */
#pragma once

#include "sdm/volume.h"

#define SDM_N_VOXEL_TYPES 10

/* One voxel type. Alternative names are separated by '|'; the writers use the first one. */
typedef struct sdm_voxel_format {
    const char *name;
    size_t size;      /* bytes */
    int nifti;        /* the code in the field datatype of a NIfTI header */
    const char *nrrd; /* names in NRRD files; the reader removes a final "_t", as in "int16_t" */
    const char *meta; /* names in MetaImage files, without the prefix "MET_" */
} sdm_voxel_format;

/* Indexed by sdm_voxel_type. */
extern const sdm_voxel_format sdm_voxel_formats[SDM_N_VOXEL_TYPES];

/* True when `word` is one of the names in `list`, which are separated by '|'; case is ignored. */
bool sdm_is_listed(const char *word, const char *list);

/* Millimetres in a unit of length ("mm", "um" ...); 0 for an unknown unit. */
double sdm_length_unit(const char *name);

/* out[i] = slope * v + intercept, computed in double, for the n voxels v of `type` at p; big: they
 * are big-endian. */
void sdm_voxels_decode(const uint8_t *p, sdm_voxel_type type, bool big, double slope,
                       double intercept, size_t n, float *out);

/* Stores values[first .. first + n - 1], an array of the C type of `type`, at p, little endian. */
void sdm_voxels_encode(const void *values, sdm_voxel_type type, size_t first, size_t n, uint8_t *p);
