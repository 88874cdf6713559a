/* Writes maps as image files; reads and writes NumPy arrays (.npy). */
#ifndef SDM_IMAGE_H
#define SDM_IMAGE_H

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes values[nz][ny][nx] as float32. The ending of `path` selects the format: .nii and .nii.gz
   (converted to RAS), .nrrd (gzip, LPS), .mha (LPS), .npy (the array alone, without the grid).
   `text` (may be NULL) is a one-line description, stored where the format has a field for it. The
   file appears under its name only when it is complete. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM;
   SDM_E_UNSUPPORTED for another ending, listing the known ones. */
SDM_API sdm_status sdm_image_write(const char *path, const sdm_grid *grid, const float *values,
                                   const char *text, sdm_error *err);

/* Reads a .npy file (float32 or float64, C order, 1 to 4 dimensions). *values: a new block that the
   caller frees by sdm_free(); shape[d] is 1 for d >= *n_dim. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM;
   SDM_E_FORMAT: damaged; SDM_E_UNSUPPORTED: another type or order. */
SDM_API sdm_status sdm_npy_read(const char *path, double **values, size_t shape[4], int *n_dim,
                                sdm_error *err);
/* Write an array of shape[n_dim], 1 to 4 dimensions, in C order and little endian. The file appears
   under its name only when it is complete. SDM_E_ARG, SDM_E_IO, SDM_E_NOMEM. */
SDM_API sdm_status sdm_npy_write(const char *path, const float *values, const size_t *shape,
                                 int n_dim, sdm_error *err);
SDM_API sdm_status sdm_npy_write_uint32(const char *path, const uint32_t *values,
                                        const size_t *shape, int n_dim, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
