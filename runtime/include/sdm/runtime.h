/* The runtime: a model opened once, maps generated into the caller's memory from any number of
 * threads. */
#ifndef SDM_RUNTIME_H
#define SDM_RUNTIME_H

#include "sdm/check.h"
#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

/* What happens to parameters outside the range the network was trained on. They are never answered
 * in silence. */
typedef enum sdm_range_policy {
    SDM_RANGE_REFUSE = 0, /* SDM_E_RANGE */
    SDM_RANGE_CLAMP,      /* moved to the nearest allowed value, flagged in the result */
    SDM_RANGE_EXACT /* computed by the exact engine from the shape, flagged in the result; needs an
                       instance */
} sdm_range_policy;

typedef enum sdm_source { SDM_SOURCE_NETWORK = 0, SDM_SOURCE_EXACT = 1 } sdm_source;

/* Why the exact engine made a map. */
typedef enum sdm_reason {
    SDM_REASON_NONE = 0,
    SDM_REASON_RANGE = 1, /* a parameter outside the trained range */
    SDM_REASON_ERROR = 2  /* the network's map was over max_error_mm */
} sdm_reason;

/* How one map was made. */
typedef struct sdm_result {
    sdm_source source;
    bool clamped;      /* a parameter was moved */
    double error_mm;   /* RMSE to expect: held-out RMSE of the network; 0 for the exact engine */
    sdm_reason reason; /* of the exact engine */
    bool checked;      /* check is filled */
    sdm_check check;   /* errors found in the network's map, also when it was replaced */
} sdm_result;

/* Zero-initialise; grows at its end only. */
typedef struct sdm_generate_opts {
    sdm_range_policy policy;
    const sdm_instance *exact_shape; /* for SDM_RANGE_EXACT and checks: sdm_runtime_instance() or
                                        the caller's; else NULL */
    int n_threads;                   /* 0: the OpenMP default; same bits for every value */
    bool check;                      /* every map of the network is checked: sdm_check_map() */
    double max_error_mm;         /* > 0: checks; a worse map is replaced under SDM_RANGE_EXACT, else
                                    SDM_E_QUALITY; 0: no bound */
    sdm_check_stat max_error_of; /* the figure that max_error_mm bounds */
} sdm_generate_opts;

/* One map: values[nz][ny][nx], mm, negative inside, written at the voxels of the model's grid.
   params[n_params] in the model's order. opts, result may be NULL. SDM_E_RANGE names the parameter,
   its value and the range (NaN and infinities always fail). SDM_E_QUALITY: over max_error_mm;
   values and result are written all the same. [any thread] */
SDM_API sdm_status sdm_generate(const sdm_model *m, const double *params,
                                const sdm_generate_opts *opts, float *values, sdm_result *result,
                                sdm_error *err);

/* A batch: params[n][n_params] -> values[n][nz][ny][nx], results[n] (may be NULL). All or nothing:
   parameters of all are checked before the first is computed; the message says which one failed.
   SDM_E_QUALITY: all are written, the message names the first that is over max_error_mm. [any
   thread] */
SDM_API sdm_status sdm_generate_batch(const sdm_model *m, const double *params, size_t n,
                                      const sdm_generate_opts *opts, float *values,
                                      sdm_result *results, sdm_error *err);

/* Map and derivatives: jacobian[n_params][nz][ny][nx], mm per unit; of the network, or by
   sdm_exact_shape_jacobian() where the exact engine makes the map. At clamped parameters they are
   the network's at the end of the range. A `pod` network takes less time for it than for n_params +
   1 calls of sdm_generate(). The map changes smoothly with the parameters. Where weights are bytes
   it differs from that of sdm_generate() by rounding: of cochleas 2e-4 mm (root mean square), 2e-3
   mm at most; and rounding adds to a derivative, of the largest one by the same parameter, 2e-4
   (root mean square), 1.5e-3 at most. Errors as above, SDM_E_PLUGIN as there. [any thread] */
SDM_API sdm_status sdm_generate_jacobian(const sdm_model *m, const double *params,
                                         const sdm_generate_opts *opts, float *values,
                                         float *jacobian, sdm_result *result, sdm_error *err);

/* Map and derivative along direction[n_params]: tangent[nz][ny][nx] = J direction, mm, cheaper than
   the Jacobian; otherwise the same. [any thread] */
SDM_API sdm_status sdm_generate_jvp(const sdm_model *m, const double *params,
                                    const double *direction, const sdm_generate_opts *opts,
                                    float *values, float *tangent, sdm_result *result,
                                    sdm_error *err);

/* gradient[n_params] = J^T adjoint[nz][ny][nx]: the derivative of any function of the map from its
   derivative by the voxels, at the cost of a few maps whatever the number of parameters. There is
   no map, so `check` and `max_error_mm` do nothing; otherwise as sdm_generate_jacobian(). [any
   thread] */
SDM_API sdm_status sdm_generate_vjp(const sdm_model *m, const double *params, const float *adjoint,
                                    const sdm_generate_opts *opts, double *gradient,
                                    sdm_result *result, sdm_error *err);

/* The shape the model was trained on, with its options, from a registry that knows it; checks that
   the parameters agree. Only what needs the exact shape needs this. SDM_E_PLUGIN when the registry
   does not have it; SDM_E_IO: a data file is neither where it was when the network was trained nor
   beside the model; SDM_E_FORMAT: it has another content. */
SDM_API sdm_status sdm_runtime_instance(const sdm_model *m, const sdm_registry *r,
                                        sdm_instance **out, sdm_error *err);

/* Exact map of a shape at p: mesh, engine, map, in one call. report may be NULL. [any thread] */
SDM_API sdm_status sdm_exact_shape_map(const sdm_instance *shape, const double *p,
                                       const sdm_exact_opts *opts, const sdm_grid *grid,
                                       float *values, sdm_exact_report *report, sdm_error *err);

/* Exact map and its derivatives: jacobian[n_params][nz][ny][nx], mm per unit of the parameter
   (sdm_exact_map_derivative() says what it is and where there is none), from
   sdm_instance_velocity(). values, report may be NULL. SDM_E_PLUGIN when the number of vertices
   depends on the parameters. [any thread] */
SDM_API sdm_status sdm_exact_shape_jacobian(const sdm_instance *shape, const double *p,
                                            const sdm_exact_opts *opts, const sdm_grid *grid,
                                            float *values, float *jacobian,
                                            sdm_exact_report *report, sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
