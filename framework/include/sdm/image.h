/* Maps on disk: images and .npy arrays. */
#ifndef SDM_IMAGE_H
#define SDM_IMAGE_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes float32 values[nz][ny][nx] atomically; the type follows the name: .nii .nii.gz (RAS,
   converted), .nrrd (gzip), .mha (LPS), .npy ([nz][ny][nx], no grid). `text` (may be NULL) is a
   one-line description kept where the format has a place. SDM_E_UNSUPPORTED for another name,
   listing those known. */
SDM_API sdm_status sdm_image_write(const char *path, const sdm_grid *grid, const float *values,
                                   const char *text, sdm_error *err);

/* Reads a .npy file (float32/float64, C order, 1 to 4 dimensions) into new memory (sdm_free()). */
SDM_API sdm_status sdm_npy_read(const char *path, double **values, size_t shape[4], int *n_dim,
                                sdm_error *err);
/* Write an array of 1 to 4 dimensions atomically, little endian, C order. */
SDM_API sdm_status sdm_npy_write(const char *path, const float *values, const size_t *shape,
                                 int n_dim, sdm_error *err);
SDM_API sdm_status sdm_npy_write_uint32(const char *path, const uint32_t *values,
                                        const size_t *shape, int n_dim, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
