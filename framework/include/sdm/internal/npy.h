/* NumPy arrays of other types than those of sdm/image.h. */
#pragma once

#include <stddef.h>

#include "sdm/status.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Writes float64 values of shape[n_dim]; the rest as sdm_npy_write(). */
sdm_status sdm_npy_write_double(const char *path, const double *values, const size_t *shape,
                                int n_dim, sdm_error *err);

#ifdef __cplusplus
}
#endif
