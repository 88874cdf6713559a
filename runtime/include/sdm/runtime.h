/* Maps of a model and their derivatives, at given parameters, into the memory of the caller.
   sdm_generate() is the function that most programs need; sdm/sdmgen.h has an example. */
#ifndef SDM_RUNTIME_H
#define SDM_RUNTIME_H

#include "sdm/check.h"
#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What a call does with parameters outside the range that the network was trained on. The caller
   always sees it: by an error, or by a flag in sdm_result. */
typedef enum sdm_range_policy {
    /* The call fails with SDM_E_RANGE. */
    SDM_RANGE_REFUSE = 0,
    /* Parameters are moved to the nearest allowed value; the result has `clamped` set. */
    SDM_RANGE_CLAMP,
    /* The exact engine computes the map from the shape, sdm_generate_opts.exact_shape. The result
       has `source` SDM_SOURCE_EXACT. */
    SDM_RANGE_EXACT
} sdm_range_policy;

/* What a call does with points outside of the box of the voxel centres of the model's grid
   (sdm/field.h). */
typedef enum sdm_outside {
    /* The call fails with SDM_E_RANGE. */
    SDM_OUTSIDE_REFUSE = 0,
    /* The value is a lower bound of the distance to the part of the solid in the box. */
    SDM_OUTSIDE_BOUND,
    /* The exact engine computes the distance; needs exact_shape. */
    SDM_OUTSIDE_EXACT
} sdm_outside;

typedef enum sdm_source { SDM_SOURCE_NETWORK = 0, SDM_SOURCE_EXACT = 1 } sdm_source;

/* Why the exact engine computed a map. */
typedef enum sdm_reason {
    SDM_REASON_NONE = 0,
    SDM_REASON_RANGE = 1, /* a parameter outside the trained range */
    SDM_REASON_ERROR = 2  /* the error of the network's map was above max_error_mm */
} sdm_reason;

/* How a map was computed. */
typedef struct sdm_result {
    sdm_source source;
    bool clamped; /* a parameter was moved into its range */
    /* Expected root mean square error: that of the network on held-out maps; 0 if exact. */
    double error_mm;
    sdm_reason reason; /* why source is SDM_SOURCE_EXACT */
    bool checked;      /* `check` is valid */
    sdm_check check;   /* check of the network's map, even if an exact one has replaced it */
    /* The shape reaches the border of the grid, where its surface ends open: the map holds a part
       of it. Set by sdm_generate(), _batch(), _jacobian(), _jvp() and _grid(); an axis of one voxel
       has no border. */
    bool cut;
} sdm_result;

/* Initialise with zeros. Later versions add members at the end only. */
typedef struct sdm_generate_opts {
    sdm_range_policy policy;
    /* The shape of the exact engine, from sdm_runtime_instance() or the caller's own. Needed with
       SDM_RANGE_EXACT, SDM_OUTSIDE_EXACT, `check` and max_error_mm; else NULL. */
    const sdm_instance *exact_shape;
    int n_threads; /* 0: the OpenMP default; the same bits for every value */
    bool check;    /* checks every map of the network with sdm_check_map() */
    /* > 0: every map of the network is checked. If its error is larger, the policy decides.
       SDM_RANGE_EXACT: an exact map replaces it. Others: the call returns SDM_E_QUALITY. 0: no
       bound. */
    double max_error_mm;
    sdm_check_stat max_error_of; /* the statistic that max_error_mm bounds */
    sdm_outside outside;         /* points and grids that leave the model's box (sdm/field.h) */
} sdm_generate_opts;

/* One map: values[nz][ny][nx] on the model's grid, mm, negative inside, for params[n_params] in the
   model's order (sdm_model_info.params). opts and result may be NULL. SDM_E_RANGE: a parameter is
   outside its range (SDM_RANGE_REFUSE) or not finite; the message names it. SDM_E_QUALITY: the
   error is above max_error_mm; values and result are written nevertheless. [any thread] */
SDM_API sdm_status sdm_generate(const sdm_model *m, const double *params,
                                const sdm_generate_opts *opts, float *values, sdm_result *result,
                                sdm_error *err);

/* n maps: params[n][n_params] -> values[n][nz][ny][nx], results[n] (may be NULL). All parameters
   are checked before the first map is computed; if one fails, no map is written and the message
   says which one. SDM_E_QUALITY: all maps are written; the message names the first one above
   max_error_mm. [any thread] */
SDM_API sdm_status sdm_generate_batch(const sdm_model *m, const double *params, size_t n,
                                      const sdm_generate_opts *opts, float *values,
                                      sdm_result *results, sdm_error *err);

/* Map and derivatives: jacobian[n_params][nz][ny][nx] = derivative of the map by each parameter, mm
   per unit of the parameter. They come from the network, or from sdm_exact_shape_jacobian() if the
   exact engine computes the map. For clamped parameters they are those at the end of the range. A
   `pod` network takes less time for them than for n_params + 1 calls of sdm_generate().
   - Accuracy: the derivatives have the error of the network. The training has measured it for the
     worst parameter: sdm_model_check_use(SDM_USE_DERIVATIVE) tells whether it is below 20 %. Where
     walls are thin beside the voxels it may be several times the derivative;
     sdm_exact_shape_jacobian() is exact.
   - Jumps: near the surface the map is smooth in the parameters. Far from it the map of a template
     jumps where another part of the shape becomes the nearest one, by up to half a voxel in the
     models measured: compare derivatives with differences near the surface only.
   - Rounding: if weights are stored as bytes, `values` differ from those of sdm_generate(): by
     about a thousandth of a voxel or less (root mean square), at most a hundredth, in the models
     measured. The derivatives of cochleas are off by 2e-4 (at most 1.5e-3) of the largest one.
     To compare derivatives with differences of maps, take maps of this function and steps of 0.1 to
     0.3 % of the range to either side; maps of sdm_generate() need steps of 3 %.
   Errors as for sdm_generate() and sdm_exact_shape_jacobian(). [any thread] */
SDM_API sdm_status sdm_generate_jacobian(const sdm_model *m, const double *params,
                                         const sdm_generate_opts *opts, float *values,
                                         float *jacobian, sdm_result *result, sdm_error *err);

/* Map and directional derivative: tangent[nz][ny][nx] = J direction, mm, with direction[n_params]
   and the Jacobian J of sdm_generate_jacobian(), with its errors. Takes less time than the
   Jacobian; otherwise as sdm_generate_jacobian(). [any thread] */
SDM_API sdm_status sdm_generate_jvp(const sdm_model *m, const double *params,
                                    const double *direction, const sdm_generate_opts *opts,
                                    float *values, float *tangent, sdm_result *result,
                                    sdm_error *err);

/* gradient[n_params] = J^T adjoint[nz][ny][nx]. If `adjoint` is the derivative of a function of the
   map by its voxels, `gradient` is the derivative of this function by the parameters. It has the
   errors of J; for the volume, sdm_model_check_use(SDM_USE_VOLUME_DERIVATIVE) judges it. It costs
   as much as 4 to 6 maps, for any number of parameters; with "deepsdf" and "imnet" as much as the
   Jacobian. No map is computed, so `check` and `max_error_mm` have no effect; otherwise as
   sdm_generate_jacobian(). [any thread] */
SDM_API sdm_status sdm_generate_vjp(const sdm_model *m, const double *params, const float *adjoint,
                                    const sdm_generate_opts *opts, double *gradient,
                                    sdm_result *result, sdm_error *err);

/* *out = the shape that the model was trained on, with the same options, from a registry that
   contains it; free with sdm_instance_free(). The exact engine needs it, networks do not.
   SDM_E_PLUGIN: the registry does not contain the shape; its parameters differ from the model's; or
   it was changed after the training: at the default parameters or three others its mesh has another
   volume, area or moment (by more than 1e-6).
   Data files of the shape must lie in the model's folder (sdm_model_info.folder), under the last
   part of the name that the model holds. SDM_E_IO: a file is missing, or the model was opened from
   memory. SDM_E_UNSUPPORTED: it is a symbolic link. SDM_E_FORMAT: its content differs from that in
   training. For files elsewhere make the instance with sdm_instance_create(). */
SDM_API sdm_status sdm_runtime_instance(const sdm_model *m, const sdm_registry *r,
                                        sdm_instance **out, sdm_error *err);

/* Exact map of a shape at p: builds mesh and engine and computes the map. report may be NULL. [any
   thread] */
SDM_API sdm_status sdm_exact_shape_map(const sdm_instance *shape, const double *p,
                                       const sdm_exact_opts *opts, const sdm_grid *grid,
                                       float *values, sdm_exact_report *report, sdm_error *err);

/* Exact map and its derivatives: jacobian[n_params][nz][ny][nx], mm per unit of the parameter,
   computed from sdm_instance_velocity(). sdm_exact_map_derivative() defines them, also where the
   distance has no derivative. values and report may be NULL. SDM_E_PLUGIN: the number of vertices
   depends on the parameters. [any thread] */
SDM_API sdm_status sdm_exact_shape_jacobian(const sdm_instance *shape, const double *p,
                                            const sdm_exact_opts *opts, const sdm_grid *grid,
                                            float *values, float *jacobian,
                                            sdm_exact_report *report, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
