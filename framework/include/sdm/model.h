/* A trained network and its file: everything needed to use it without the plug-in or the config. */
#ifndef SDM_MODEL_H
#define SDM_MODEL_H

#include <stdbool.h>

#include "sdm/grid.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_MODEL_NAME_MAX 64

/* A shape parameter as the network was trained on it. */
typedef struct sdm_model_param {
    char name[SDM_MODEL_NAME_MAX], unit[16];
    double min, max, def;
} sdm_model_param;

/* Held-out figures measured at the end of training (fresh random shapes, exact distances as truth).
 */
typedef struct sdm_accuracy {
    int64_t samples;
    double mse_mm2, rmse_mm, mae_mm, max_abs_mm;
    double rmse_near_mm;           /* where |distance| <= 0.4 mm */
    double q50_mm, q90_mm, q99_mm; /* quantiles over the shapes of the RMSE of one map */
} sdm_accuracy;

/* What a model says about itself. Texts are NUL-terminated and owned by the model. */
typedef struct sdm_model_info {
    char shape[SDM_MODEL_NAME_MAX];
    char kind[16];    /* of network, e.g. "pod" */
    char version[16]; /* of the program that trained it */
    size_t n_params;
    const sdm_model_param *params;
    size_t n_options; /* options of the shape, as text, for the exact engine; behind an option NAME
                         that is a file NAME.crc64, the checksum of its content when the network was
                         trained */
    const char *const *option_names, *const *option_values;
    sdm_grid grid;
    sdm_accuracy accuracy;
    uint64_t seed;
    double train_seconds;
    int64_t train_samples; /* exact maps seen */
    uint64_t checksum;     /* of the whole file */
    size_t file_bytes, weight_bytes;
    double macs;        /* multiply-adds of one map */
    const char *config; /* resolved config, YAML */
    const char *folder; /* of the file; NULL: the model was in memory */
} sdm_model_info;

/* Immutable once opened: any number of threads may use one model. */
typedef struct sdm_model sdm_model;

/* Reads and checks a model file: every size against the file's length before anything is allocated,
   every checksum. SDM_E_IO; SDM_E_FORMAT: not a model, damaged, truncated, or of a newer version.
 */
SDM_API sdm_status sdm_model_open(const char *path, sdm_model **out, sdm_error *err);
/* The same for a file that is in memory; the bytes are copied. `name` stands for the file in
 * messages. */
SDM_API sdm_status sdm_model_open_memory(const char *name, const uint8_t *bytes, size_t size,
                                         sdm_model **out, sdm_error *err);
SDM_API void sdm_model_free(sdm_model *m);
SDM_API const sdm_model_info *sdm_model_get_info(const sdm_model *m);

/* Bytes of scratch memory that one call of sdm_model_forward needs for a batch of n. */
SDM_API size_t sdm_model_scratch_bytes(const sdm_model *m, size_t n);

/* values[n][nz][ny][nx] = the maps at params[n][n_params], mm, written; no checks of the
   parameters, no allocation. scratch: sdm_model_scratch_bytes(m, n), 64-byte aligned. One thread.
   [any thread] */
SDM_API void sdm_model_forward(const sdm_model *m, const double *params, size_t n, float *values,
                               void *scratch);

/* Bytes of scratch memory for sdm_model_jacobian. */
SDM_API size_t sdm_model_jacobian_scratch_bytes(const sdm_model *m);

/* The map and its derivatives by forward mode: values[nz][ny][nx], jacobian[n_params][nz][ny][nx]
   (mm per unit of the parameter). One thread, no allocation. [any thread] */
SDM_API void sdm_model_jacobian(const sdm_model *m, const double *params, float *values,
                                float *jacobian, void *scratch);

/* The map and its derivative along direction[n_params] (mm per unit of the direction) by forward
   mode, cheaper than the Jacobian: values[nz][ny][nx], tangent[nz][ny][nx]. One thread, no
   allocation; scratch as above. [any thread] */
SDM_API size_t sdm_model_jvp_scratch_bytes(const sdm_model *m);
SDM_API void sdm_model_jvp(const sdm_model *m, const double *params, const double *direction,
                           float *values, float *tangent, void *scratch);

/* gradient[n_params] = sum over voxels of adjoint[nz][ny][nx] times d value / d parameter, by
   reverse mode, at the cost of a few maps whatever the number of parameters. One thread, no
   allocation; scratch as above. [any thread] */
SDM_API size_t sdm_model_vjp_scratch_bytes(const sdm_model *m);
SDM_API void sdm_model_vjp(const sdm_model *m, const double *params, const float *adjoint,
                           double *gradient, void *scratch);

/* tangent[n] = J direction[P], and gradient[P] = J^T adjoint[n], for a Jacobian J[P][n] that is
 * there. [any thread] */
SDM_API void sdm_jacobian_times(const float *jacobian, size_t n_params, size_t n,
                                const double *direction, float *tangent);
SDM_API void sdm_jacobian_transposed_times(const float *jacobian, size_t n_params, size_t n,
                                           const float *adjoint, double *gradient);

#ifdef __cplusplus
}
#endif
#endif
