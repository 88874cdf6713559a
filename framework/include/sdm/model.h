/* A model: a trained network, read from its file. The network needs no plug-in and no
   configuration; exact distances need the shape (sdm_runtime_instance()). sdm/runtime.h computes
   maps. */
#ifndef SDM_MODEL_H
#define SDM_MODEL_H

#include <stdbool.h>

#include "sdm/grid.h"
#include "sdm/shape.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_MODEL_NAME_MAX 64

/* A parameter of the shape: name, unit ("mm", ...), the range min < max on which the network was
   trained, the default value, and the distribution from which the training drew it. */
typedef struct sdm_model_param {
    char name[SDM_MODEL_NAME_MAX], unit[16];
    double min, max, def;
    sdm_distribution distribution;
} sdm_model_param;

/* Errors of the network on random shapes that were not used in training, measured at the end of
   training against exact distances. */
typedef struct sdm_accuracy {
    int64_t samples; /* number of shapes */
    double mse_mm2, rmse_mm, mae_mm, max_abs_mm;
    double rmse_near_mm;           /* RMSE over voxels with abs(exact distance) <= near_mm */
    double q50_mm, q90_mm, q99_mm; /* 50, 90, 99 % quantiles, over the shapes, of a map's RMSE */
    double near_mm; /* two voxels (their shortest edge); 0.4 mm in models of earlier versions */
} sdm_accuracy;

#define SDM_MODEL_PROBES 3
/* Size of the text sdm_model_quality.unfit. */
#define SDM_MODEL_UNFIT 1600

/* The verdict of the training on the model. In models of earlier versions `grade` is "". A number
   that is not known is NaN. */
typedef struct sdm_model_quality {
    char grade[16]; /* "good", "usable" or "poor" */
    /* fraction of the held-out shapes that do not fit into the grid: their surfaces end open at its
       border */
    double cut;
    /* Error of interpolation, which sdm_accuracy does not contain: how far exact maps, interpolated
       linearly between the voxels, miss the surface of held-out shapes; root mean square, mm */
    double between_mm;
    /* thickness of the thinnest part of a few held-out shapes, mm. On voxels longer than about 0.7
       times this thickness, surfaces lack the part or show it broken */
    double thickness_mm;
    /* volume and area of the mesh at the default parameters, sums over its triangles. By them
       sdm_runtime_instance() recognises a shape that was changed after the training */
    double mesh_volume_mm3, mesh_area_mm2;
    /* an integral over the same mesh that changes where a part is moved or mirrored */
    double mesh_moment_mm3;
    /* Relative errors on held-out shapes: root mean square of the error over that of the exact
       values.
       volume_error: of the volume of a map (sdm_map_volume()); up to 20 shapes.
       derivative_error: of the derivatives of the map at voxels within half a voxel of the surface,
       by the worst parameter; up to 32 shapes, fewer with more than twelve parameters or in a short
       training.
       volume_derivative_error: of the derivatives of the volume, by the worst parameter. One that
       changes the volume by less than 5 % over its range counts as if it changed it by 5 %. `unfit`
       names it if the error is above 20 % of its own derivative */
    double volume_error, derivative_error, volume_derivative_error;
    /* as volume_error, of the volume inside the surface of a map (sdm_isosurface()). This surface
     * cuts off edges and thin walls between the voxels */
    double surface_volume_error;
    /* largest error of distances farther than sdm_accuracy.near_mm from the surface, mm */
    double far_error_mm;
    /* as mesh_volume_mm3, mesh_area_mm2 and mesh_moment_mm3, at three other parameter vectors */
    double probe_volume_mm3[SDM_MODEL_PROBES], probe_area_mm2[SDM_MODEL_PROBES];
    double probe_moment_mm3[SDM_MODEL_PROBES];
    /* the uses for which the training found the model not good enough, in words: lines that end
       with '\n'; "": none, or not known */
    char unfit[SDM_MODEL_UNFIT];
} sdm_model_quality;

/* Relative errors above which a model is not for volumes, and not for derivatives. */
#define SDM_VOLUME_BAD 0.02
#define SDM_DERIVATIVE_BAD 0.2

/* Uses of a model, for sdm_model_check_use(). Behind each: the condition, in members of
   sdm_model_quality, under which the model is not good enough for it. */
typedef enum sdm_model_use {
    SDM_USE_SURFACE = 0,           /* surfaces and level sets: the grade is "poor" */
    SDM_USE_VOLUME = 1,            /* of maps: volume_error > SDM_VOLUME_BAD */
    SDM_USE_DERIVATIVE = 2,        /* of maps by the parameters, as of sdm_generate_jacobian() and
                                      --jacobian: derivative_error > SDM_DERIVATIVE_BAD */
    SDM_USE_VOLUME_DERIVATIVE = 3, /* volume_derivative_error > SDM_DERIVATIVE_BAD; parameters that
                                      hardly change the volume: sdm_model_check_use() */
    SDM_USE_DISTANCE = 4,          /* far from the surface: far_error_mm > a voxel */
    SDM_USE_SURFACE_VOLUME = 5     /* inside surfaces: surface_volume_error > SDM_VOLUME_BAD */
} sdm_model_use;

/* Description of a model. All pointers stay valid until sdm_model_free(); texts are
   NUL-terminated. */
typedef struct sdm_model_info {
    char shape[SDM_MODEL_NAME_MAX];
    char kind[16];    /* kind of network: "pod", "template", "deepsdf", "imnet", "sdmnn" */
    char version[16]; /* version of the program that trained the network */
    size_t n_params;
    const sdm_model_param *params; /* [n_params] */
    /* Options of the shape as text, for exact distances. If the value of an option NAME is a file,
       the text is the name of a copy in the folder of the model, and the next option, NAME.crc64,
       is the CRC-64 of its content at the time of training. */
    size_t n_options;
    const char *const *option_names, *const *option_values; /* [n_options] */
    sdm_grid grid;                                          /* grid of every map of the model */
    sdm_accuracy accuracy;
    uint64_t seed; /* seed of the training */
    double train_seconds;
    int64_t train_samples; /* exact maps used in training */
    uint64_t checksum;     /* CRC-64 of the file, without its last 8 bytes */
    size_t file_bytes, weight_bytes;
    double macs;        /* number of multiply-adds for one map */
    const char *config; /* configuration of the training with all defaults filled in, YAML */
    const char *folder; /* folder of the file with a final '/'; NULL: opened from memory */
    size_t fine_width;  /* units of a layer of the fine level (sdm/field.h); 0: none */
    sdm_model_quality quality;
} sdm_model_info;

/* Immutable after opening: any number of threads may use one model at the same time. */
typedef struct sdm_model sdm_model;

/* *out = the model of a file; free it with sdm_model_free(). On error *out is NULL. All checksums
   are verified, and all sizes are compared with the length of the file before memory is allocated.
   SDM_E_IO: the file cannot be read. SDM_E_FORMAT: it is no model (a checkpoint is none), is
   damaged, or has another format version. SDM_E_ARG: path or out is NULL. SDM_E_NOMEM. [any thread]
 */
SDM_API sdm_status sdm_model_open(const char *path, sdm_model **out, sdm_error *err);

/* The same for the content of a file, bytes[size], which is copied. `name` stands for the file in
   error messages. [any thread] */
SDM_API sdm_status sdm_model_open_memory(const char *name, const uint8_t *bytes, size_t size,
                                         sdm_model **out, sdm_error *err);

/* Frees a model, which no thread may use any more; m may be NULL. */
SDM_API void sdm_model_free(sdm_model *m);

/* The description, owned by the model. [any thread] */
SDM_API const sdm_model_info *sdm_model_get_info(const sdm_model *m);

/* SDM_OK: the training found the model good enough for this use. SDM_E_QUALITY: not good enough;
   the message has the figure, as in "derivatives of volumes of its maps are off by 165 % for alpha,
   more than 20 %". A model passes SDM_USE_VOLUME_DERIVATIVE with a parameter that hardly changes
   the volume, whatever the error of the derivative by it, even where its sign is wrong. So after
   SDM_OK of this use err->text names such parameters with an error above 20 %: "do not use the
   derivatives of the volume by open: off by 167 % of their own size: ..."; "": there are none.
   `unfit` has the same line. SDM_E_UNSUPPORTED: the training did not measure it (slow kinds of
   network, earlier versions). SDM_E_ARG: m is NULL, or there is no such use. Functions that compute
   maps, volumes and derivatives do not call this function: call it before you use their results.
   [any thread] */
SDM_API sdm_status sdm_model_check_use(const sdm_model *m, sdm_model_use use, sdm_error *err);

/* Index of a parameter in the parameter vectors of the model; -1 if there is none of this name, or
   if the model or the name is NULL. [any thread] */
SDM_API int sdm_model_param_index(const sdm_model *m, const char *name);

/* Low-level functions: most programs call sdm_generate() and its relatives (sdm/runtime.h), which
   check the parameters. The functions below evaluate the network in the calling thread, without
   allocation and without checks: parameters must be finite and within their ranges, in the order
   and the units of sdm_model_info.params. `scratch` is memory of the caller, 64-byte aligned, of at
   least the size that the function's ..._scratch_bytes() returns; concurrent calls need separate
   scratch memory. Maps are signed distances in mm, negative inside, values[nz][ny][nx] with x
   fastest. */

/* Bytes of scratch memory of sdm_model_forward() for n maps. [any thread] */
SDM_API size_t sdm_model_scratch_bytes(const sdm_model *m, size_t n);

/* values[n][nz][ny][nx] = the maps at params[n][n_params]. [any thread] */
SDM_API void sdm_model_forward(const sdm_model *m, const double *params, size_t n, float *values,
                               void *scratch);

/* Bytes of scratch memory of sdm_model_jacobian(). [any thread] */
SDM_API size_t sdm_model_jacobian_scratch_bytes(const sdm_model *m);

/* values[nz][ny][nx] = the map at params[n_params], jacobian[n_params][nz][ny][nx] = its derivative
   by each parameter, mm per unit of the parameter (forward-mode differentiation).
   sdm_model_check_use(SDM_USE_DERIVATIVE) tells whether these, and the products below, are right
   within 20 %. [any thread] */
SDM_API void sdm_model_jacobian(const sdm_model *m, const double *params, float *values,
                                float *jacobian, void *scratch);

/* Bytes of scratch memory of sdm_model_jvp(). [any thread] */
SDM_API size_t sdm_model_jvp_scratch_bytes(const sdm_model *m);

/* Jacobian-vector product: values[nz][ny][nx] = the map, tangent[nz][ny][nx] = the sum over the
   parameters p of direction[p] * d values / d params[p]. Costs at most as much as the Jacobian, and
   less for "pod", "template" and "sdmnn". [any thread] */
SDM_API void sdm_model_jvp(const sdm_model *m, const double *params, const double *direction,
                           float *values, float *tangent, void *scratch);

/* Bytes of scratch memory of sdm_model_vjp(). [any thread] */
SDM_API size_t sdm_model_vjp_scratch_bytes(const sdm_model *m);

/* Vector-Jacobian product: gradient[n_params], with gradient[p] = the sum over the voxels v of
   adjoint[v] * d values[v] / d params[p]; adjoint[nz][ny][nx]. "pod", "template" and "sdmnn" use
   reverse-mode differentiation, which costs as much as a few maps for any number of parameters;
   "deepsdf" and "imnet" form the Jacobian. [any thread] */
SDM_API void sdm_model_vjp(const sdm_model *m, const double *params, const float *adjoint,
                           double *gradient, void *scratch);

/* The same two products with a given jacobian[n_params][n]:
   tangent[i] = sum over p of direction[p] * jacobian[p][i], tangent[n], direction[n_params];
   gradient[p] = sum over i of adjoint[i] * jacobian[p][i], gradient[n_params], adjoint[n].
   [any thread] */
SDM_API void sdm_jacobian_times(const float *jacobian, size_t n_params, size_t n,
                                const double *direction, float *tangent);
SDM_API void sdm_jacobian_transposed_times(const float *jacobian, size_t n_params, size_t n,
                                           const float *adjoint, double *gradient);

#ifdef __cplusplus
}
#endif
#endif
