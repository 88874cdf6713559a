/* Computes maps and derivatives of a model: applies the range policy, spreads batches over threads,
   and computes exact maps where the policy asks for them. */
#include "sdm/runtime.h"

#include <math.h>
#include <string.h>

#include "check_results.h"
#include "generate_parts.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/text.h"
#include "sdm/internal/threads.h"

/* Number of maps in a slice of a batch. It is fixed, so that the arithmetic of a map does not
   depend on the number of threads. */
#define SLICE 24u
/* Several threads may share one map: one more thread for every SHARE_MACS multiply-adds of the
   network (about 50 us), at most SHARE_MAX. */
#define SHARE_MAX 256
#define SHARE_MACS 1e6

static int thread_count(int wanted, size_t max)
{
    const int n = sdm_threads(wanted);
    return (size_t)n < max ? n : (int)max;
}

/* Number of threads for a map that several threads share. */
static int sharing_threads(const sdm_model *m, int wanted)
{
    const double max = fmin(1 + sdm_model_get_info(m)->macs / SHARE_MACS, SHARE_MAX);
    return thread_count(wanted, (size_t)max);
}

sdm_status sdm_generate_check_options(const sdm_model *m, const sdm_generate_opts *opts,
                                      sdm_generate_opts *o, sdm_error *err)
{
    *o = opts ? *opts : (sdm_generate_opts){.policy = SDM_RANGE_REFUSE};
    if (o->n_threads < 0)
        return sdm_fail(err, SDM_E_ARG, "%d threads, need 0 (all) or more", o->n_threads);
    if (o->policy != SDM_RANGE_REFUSE && o->policy != SDM_RANGE_CLAMP &&
        o->policy != SDM_RANGE_EXACT)
        return sdm_fail(err, SDM_E_ARG, "range policy %d is unknown", (int)o->policy);
    if (!(o->max_error_mm >= 0) || isinf(o->max_error_mm))
        return sdm_fail(err, SDM_E_ARG,
                        "largest error %g mm, need a positive number, or 0 for none",
                        o->max_error_mm);
    if ((unsigned)o->max_error_of > SDM_CHECK_MEAN)
        return sdm_fail(err, SDM_E_ARG, "figure %d of a check is unknown", (int)o->max_error_of);
    if ((unsigned)o->outside > SDM_OUTSIDE_EXACT)
        return sdm_fail(err, SDM_E_ARG, "option %d for points outside is unknown", (int)o->outside);
    const bool exact = o->policy == SDM_RANGE_EXACT || o->outside == SDM_OUTSIDE_EXACT;
    if (!exact && !sdm_wants_check(o)) return SDM_OK;
    if (!o->exact_shape)
        return sdm_fail(err, SDM_E_ARG, "%s an instance of the shape (sdm_runtime_instance())",
                        exact ? "the exact policy needs" : "checks need");
    size_t n;
    sdm_instance_params(o->exact_shape, &n);
    const sdm_model_info *info = sdm_model_get_info(m);
    if (n != info->n_params)
        return sdm_fail(err, SDM_E_ARG,
                        "the model has %zu parameters, the shape for the exact engine %zu",
                        info->n_params, n);
    return SDM_OK;
}

static sdm_status refuse_param(const sdm_model_param *p, double value, sdm_error *err)
{
    sdm_error range = {0};
    sdm_fail_range(p->name, value, p->min, p->max, p->unit, &range);
    // for all policies; and who gave another unit needs no policy
    if (!isfinite(value) || *sdm_unit_question(value, p->min, p->max, p->unit))
        return sdm_fail(err, SDM_E_RANGE, "%s", range.text);
    return sdm_fail(
        err, SDM_E_RANGE,
        "%s, the trained range; sdm_generate_opts.policy = SDM_RANGE_CLAMP moves it into the "
        "range, SDM_RANGE_EXACT computes exact maps where the shape allows them",
        range.text);
}

sdm_status sdm_generate_check_params(const sdm_model *m, const double *params,
                                     const sdm_generate_opts *o, double *used, sdm_result *result,
                                     sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    *result = (sdm_result){.source = SDM_SOURCE_NETWORK, .error_mm = info->accuracy.rmse_mm};
    for (size_t i = 0; i < info->n_params; i++) {
        const sdm_model_param *p = &info->params[i];
        const double x = params[i], near = x < p->min ? p->min : x > p->max ? p->max : x;
        if (!isfinite(x) || (x != near && o->policy == SDM_RANGE_REFUSE))
            return refuse_param(p, x, err);
        if (x != near && o->policy == SDM_RANGE_CLAMP) result->clamped = true;
        if (x != near && o->policy == SDM_RANGE_EXACT) result->source = SDM_SOURCE_EXACT;
        if (used) used[i] = near;
    }
    if (result->source == SDM_SOURCE_NETWORK) return SDM_OK;
    result->error_mm = 0.0;
    result->reason = SDM_REASON_RANGE;
    return sdm_instance_check(o->exact_shape, params, err);
}

/* Computes those maps of a slice that come from the network: each uninterrupted run of such maps in
   one call. */
static void forward_slice(const sdm_model *m, const double *used, const sdm_result *results,
                          size_t n, int n_threads, float *values, void *scratch)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t voxels = sdm_grid_count(&info->grid);
    for (size_t first = 0; first < n;) {
        size_t last = first;
        while (last < n && results[last].source == SDM_SOURCE_NETWORK) last++;
        if (last > first)
            sdm_model_forward_threads(m, used + first * info->n_params, last - first,
                                      values + first * voxels, scratch, n_threads);
        first = last + 1;
    }
}

/* Computes all maps of a batch that come from the network. wanted: number of threads, 0: the OpenMP
   default. */
static sdm_status forward_batch(const sdm_model *m, const double *used, const sdm_result *results,
                                size_t n, int wanted, float *values, sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t voxels = sdm_grid_count(&info->grid), slices = (n + SLICE - 1) / SLICE;
    // either each thread computes whole slices, or all threads share the maps of one slice
    const int all = sharing_threads(m, wanted),
              inner = n == 1 || sdm_model_is_threaded(m) ? all : 1;
    const int threads = inner > 1 ? 1 : thread_count(wanted, slices);
    const size_t bytes =
        (sdm_model_scratch_bytes_threads(m, n < SLICE ? n : SLICE, inner) + 63) / 64 * 64;
    uint8_t *scratch = NULL;
    size_t total;
    sdm_status s = sdm_mul(bytes, (size_t)threads, &total, err);
    if (!s) s = SDM_ALLOC(&scratch, total, "memory of the network", err);
    if (s) return s;
#pragma omp parallel for schedule(dynamic) num_threads(threads) if (threads > 1)
    for (size_t k = 0; k < slices; k++) {
        const size_t first = k * SLICE, count = n - first < SLICE ? n - first : SLICE;
        forward_slice(m, used + first * info->n_params, results + first, count, inner,
                      values + first * voxels, scratch + (size_t)sdm_thread() * bytes);
    }
    sdm_free(scratch);
    return SDM_OK;
}

/* Prefixes the message of error s with the number of the map in a batch. */
static sdm_status fail_in_map(sdm_status s, size_t n, size_t i, sdm_error *err)
{
    return s && n > 1 ? sdm_fail_in(err, s, "map %zu of %zu", i, n) : s;
}

/* Checks the parameters of all maps, then computes the maps. results[n] and used[n][n_params]
   (parameters for the network) are written even after an error. */
static sdm_status generate_all(const sdm_model *m, const double *params, size_t n,
                               const sdm_generate_opts *o, float *values, sdm_result *results,
                               double *used, sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t p = info->n_params, voxels = sdm_grid_count(&info->grid);
    bool network = false;
    for (size_t i = 0; i < n; i++) {
        const sdm_status s =
            sdm_generate_check_params(m, params + i * p, o, used + i * p, &results[i], err);
        if (s) return fail_in_map(s, n, i, err);
        network = network || results[i].source == SDM_SOURCE_NETWORK;
    }
    sdm_status s = network ? forward_batch(m, used, results, n, o->n_threads, values, err) : SDM_OK;
    const sdm_exact_opts exact = {.n_threads = o->n_threads};
    for (size_t i = 0; i < n && !s; i++)
        if (results[i].source == SDM_SOURCE_EXACT)
            s = fail_in_map(sdm_exact_shape_map(o->exact_shape, params + i * p, &exact, &info->grid,
                                                values + i * voxels, NULL, err),
                            n, i, err);
    return !s && network && sdm_wants_check(o)
               ? sdm_check_results(m, used, n, o, values, results, err)
               : s;
}

bool sdm_generate_is_cut(const sdm_grid *g, const float *values)
{
    const int64_t nx = g->n[0], ny = g->n[1], nz = g->n[2];
    for (int64_t k = 0; k < nz; k++)
        for (int64_t j = 0; j < ny; j++) {
            const float *row = values + (k * ny + j) * nx;
            const bool whole =
                (nz > 1 && (k == 0 || k == nz - 1)) || (ny > 1 && (j == 0 || j == ny - 1));
            if (nx > 1 && (row[0] < 0 || row[nx - 1] < 0)) return true;
            for (int64_t i = 0; whole && i < nx; i++)
                if (row[i] < 0) return true;
        }
    return false;
}

sdm_status sdm_generate_batch(const sdm_model *m, const double *params, size_t n,
                              const sdm_generate_opts *opts, float *values, sdm_result *results,
                              sdm_error *err)
{
    if (!m || (n && (!params || !values)))
        return sdm_fail(err, SDM_E_ARG, "generate: model, parameters and values are needed");
    sdm_generate_opts o;
    sdm_status s = sdm_generate_check_options(m, opts, &o, err);
    if (s || !n) return s;
    const sdm_model_info *info = sdm_model_get_info(m);
    size_t count;
    if ((s = sdm_mul(n, sdm_grid_count(&info->grid), &count, err))) return s;
    if ((s = sdm_mul(n, info->n_params, &count, err))) return s;
    double *used = NULL;
    sdm_result *found = NULL;
    s = SDM_ALLOC(&used, count, "parameters of a batch", err);
    if (!s) s = SDM_ALLOC(&found, n, "results of a batch", err);
    if (!s) s = generate_all(m, params, n, &o, values, found, used, err);
    for (size_t i = 0; i < n && results && (!s || s == SDM_E_QUALITY); i++) {
        results[i] = found[i];
        results[i].cut = sdm_generate_is_cut(&info->grid, values + i * sdm_grid_count(&info->grid));
    }
    sdm_free(found);
    sdm_free(used);
    return s;
}

sdm_status sdm_generate(const sdm_model *m, const double *params, const sdm_generate_opts *opts,
                        float *values, sdm_result *result, sdm_error *err)
{
    return sdm_generate_batch(m, params, 1, opts, values, result, err);
}

/* Checks options and parameters of one map. *used = new array [n_params] with the parameters for
   the network; free with sdm_free(), also after an error. */
static sdm_status prepare_one(const sdm_model *m, const double *params,
                              const sdm_generate_opts *opts, sdm_generate_opts *o, double **used,
                              sdm_result *found, sdm_error *err)
{
    sdm_status s = sdm_generate_check_options(m, opts, o, err);
    if (!s) s = SDM_ALLOC(used, sdm_model_get_info(m)->n_params, "parameters", err);
    return s ? s : sdm_generate_check_params(m, params, o, *used, found, err);
}

/* Computes the map and its derivatives at checked parameters. */
static sdm_status jacobian_at(const sdm_model *m, const double *params, const double *used,
                              const sdm_generate_opts *o, float *values, float *jacobian,
                              sdm_result *result, sdm_error *err)
{
    sdm_status s = SDM_OK;
    if (result->source == SDM_SOURCE_NETWORK) {
        const int threads = sharing_threads(m, o->n_threads);
        uint8_t *scratch = NULL;
        s = SDM_ALLOC(&scratch, sdm_model_jacobian_scratch_bytes_threads(m, threads),
                      "memory of the network", err);
        if (!s) sdm_model_jacobian_threads(m, used, values, jacobian, scratch, threads);
        sdm_free(scratch);
        if (!s && sdm_wants_check(o)) s = sdm_check_results(m, used, 1, o, values, result, err);
    }
    if (s || result->source == SDM_SOURCE_NETWORK) return s;
    const sdm_exact_opts exact = {.n_threads = o->n_threads};
    return sdm_exact_shape_jacobian(o->exact_shape, params, &exact, &sdm_model_get_info(m)->grid,
                                    values, jacobian, NULL, err);
}

sdm_status sdm_generate_jacobian(const sdm_model *m, const double *params,
                                 const sdm_generate_opts *opts, float *values, float *jacobian,
                                 sdm_result *result, sdm_error *err)
{
    if (!m || !params || !values || !jacobian)
        return sdm_fail(err, SDM_E_ARG,
                        "generate: model, parameters, values and jacobian are needed");
    sdm_generate_opts o;
    double *used = NULL;
    sdm_result found = {0};
    sdm_status s = prepare_one(m, params, opts, &o, &used, &found, err);
    if (!s) s = jacobian_at(m, params, used, &o, values, jacobian, &found, err);
    if ((!s || s == SDM_E_QUALITY) && result) {
        *result = found;
        result->cut = sdm_generate_is_cut(&sdm_model_get_info(m)->grid, values);
    }
    sdm_free(used);
    return s;
}

/* *jacobian = new array with the exact Jacobian; free with sdm_free(). */
static sdm_status exact_jacobian(const sdm_model *m, const double *params,
                                 const sdm_generate_opts *o, float *values, float **jacobian,
                                 sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const sdm_exact_opts exact = {.n_threads = o->n_threads};
    size_t count;
    sdm_status s = sdm_mul(info->n_params, sdm_grid_count(&info->grid), &count, err);
    if (!s) s = SDM_ALLOC(jacobian, count, "Jacobian", err);
    if (!s)
        s = sdm_exact_shape_jacobian(o->exact_shape, params, &exact, &info->grid, values, *jacobian,
                                     NULL, err);
    return s;
}

/* Computes the map and its directional derivative at checked parameters. */
static sdm_status jvp_at(const sdm_model *m, const double *params, const double *used,
                         const double *direction, const sdm_generate_opts *o, float *values,
                         float *tangent, sdm_result *result, sdm_error *err)
{
    sdm_status s = SDM_OK;
    if (result->source == SDM_SOURCE_NETWORK) {
        uint8_t *scratch = NULL;
        s = SDM_ALLOC(&scratch, sdm_model_jvp_scratch_bytes(m), "memory of the network", err);
        if (!s) sdm_model_jvp(m, used, direction, values, tangent, scratch);
        sdm_free(scratch);
        if (!s && sdm_wants_check(o)) s = sdm_check_results(m, used, 1, o, values, result, err);
    }
    if (s || result->source == SDM_SOURCE_NETWORK) return s;
    const sdm_model_info *info = sdm_model_get_info(m);
    float *jacobian = NULL;
    s = exact_jacobian(m, params, o, values, &jacobian, err);
    if (!s)
        sdm_jacobian_times(jacobian, info->n_params, sdm_grid_count(&info->grid), direction,
                           tangent);
    sdm_free(jacobian);
    return s;
}

/* gradient = J^T adjoint, with the Jacobian J at checked parameters. */
static sdm_status vjp_at(const sdm_model *m, const double *params, const double *used,
                         const float *adjoint, const sdm_generate_opts *o, double *gradient,
                         const sdm_result *result, sdm_error *err)
{
    if (result->source == SDM_SOURCE_NETWORK) {
        uint8_t *scratch = NULL;
        const sdm_status s =
            SDM_ALLOC(&scratch, sdm_model_vjp_scratch_bytes(m), "memory of the network", err);
        if (!s) sdm_model_vjp(m, used, adjoint, gradient, scratch);
        sdm_free(scratch);
        return s;
    }
    const sdm_model_info *info = sdm_model_get_info(m);
    float *jacobian = NULL;
    const sdm_status s = exact_jacobian(m, params, o, NULL, &jacobian, err);
    if (!s)
        sdm_jacobian_transposed_times(jacobian, info->n_params, sdm_grid_count(&info->grid),
                                      adjoint, gradient);
    sdm_free(jacobian);
    return s;
}

sdm_status sdm_generate_jvp(const sdm_model *m, const double *params, const double *direction,
                            const sdm_generate_opts *opts, float *values, float *tangent,
                            sdm_result *result, sdm_error *err)
{
    if (!m || !params || !direction || !values || !tangent)
        return sdm_fail(err, SDM_E_ARG,
                        "generate: model, parameters, direction, values and tangent are needed");
    sdm_generate_opts o;
    double *used = NULL;
    sdm_result found = {0};
    sdm_status s = prepare_one(m, params, opts, &o, &used, &found, err);
    if (!s) s = jvp_at(m, params, used, direction, &o, values, tangent, &found, err);
    if ((!s || s == SDM_E_QUALITY) && result) {
        *result = found;
        result->cut = sdm_generate_is_cut(&sdm_model_get_info(m)->grid, values);
    }
    sdm_free(used);
    return s;
}

sdm_status sdm_generate_vjp(const sdm_model *m, const double *params, const float *adjoint,
                            const sdm_generate_opts *opts, double *gradient, sdm_result *result,
                            sdm_error *err)
{
    if (!m || !params || !adjoint || !gradient)
        return sdm_fail(err, SDM_E_ARG,
                        "generate: model, parameters, adjoint and gradient are needed");
    sdm_generate_opts o;
    double *used = NULL;
    sdm_result found = {0};
    sdm_status s = prepare_one(m, params, opts, &o, &used, &found, err);
    if (!s) s = vjp_at(m, params, used, adjoint, &o, gradient, &found, err);
    if (!s && result) *result = found;
    sdm_free(used);
    return s;
}
