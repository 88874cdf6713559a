/* Checks the maps of a network and replaces those with too large an error by exact maps. */
#include "check_results.h"

#include "sdm/internal/threads.h"
#include "sdm/memory.h"

/* NaN counts as too large. */
static bool error_too_large(const sdm_generate_opts *o, const sdm_check *c)
{
    return o->max_error_mm > 0 && !(sdm_check_get(c, o->max_error_of) <= o->max_error_mm);
}

/* The same mesh and engine serve the check and, if needed, the exact map. */
sdm_status sdm_check_result(const sdm_grid *grid, const double *p, const sdm_generate_opts *o,
                            int n_threads, float *values, sdm_result *result, sdm_error *err)
{
    sdm_mesh mesh = {0};
    sdm_exact *engine = NULL;
    sdm_status s = sdm_instance_mesh(o->exact_shape, p, &mesh, err);
    if (!s) s = sdm_exact_create(&mesh, &(sdm_exact_opts){.n_threads = n_threads}, &engine, err);
    if (!s) s = sdm_check_map(engine, grid, values, &result->check, err);
    if (!s) result->checked = true;
    if (!s && error_too_large(o, &result->check)) {
        if (o->policy == SDM_RANGE_EXACT) {
            s = sdm_exact_map(engine, grid, values, err);
            result->source = SDM_SOURCE_EXACT;
            result->reason = SDM_REASON_ERROR;
            result->error_mm = 0.0;
        } else
            s = sdm_fail(
                err, SDM_E_QUALITY,
                "error near the surface (%s of %zu voxels) %.3g mm, demanded at most %.3g mm%s",
                sdm_check_stat_name(o->max_error_of), result->check.used,
                sdm_check_get(&result->check, o->max_error_of), o->max_error_mm,
                result->clamped ? ""
                                : "; sdm_generate_opts.policy exact computes such maps exactly");
    }
    sdm_exact_free(engine);
    sdm_mesh_dispose(&mesh);
    return s;
}

/* The error to report: that of the map with the lowest index, where any other error comes before
   SDM_E_QUALITY. The choice does not depend on the number of threads. */
typedef struct first_error {
    size_t index;
    sdm_error err;
} first_error;

static void first_error_keep(first_error *first, size_t i, sdm_status s, const sdm_error *err)
{
    const bool quality = s == SDM_E_QUALITY, kept_quality = first->err.status == SDM_E_QUALITY;
    if (first->err.status && (quality != kept_quality ? quality : i > first->index)) return;
    first->index = i;
    first->err = *err;
    first->err.status = s;
}

sdm_status sdm_check_results(const sdm_model *m, const double *used, size_t n,
                             const sdm_generate_opts *o, float *values, sdm_result *results,
                             sdm_error *err)
{
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t voxels = sdm_grid_count(&info->grid);
    first_error first = {0};
    const int threads = sdm_threads(o->n_threads);
    // threads work on different maps, or share the single map
    const int outer = (size_t)threads < n ? threads : (int)n, inner = outer > 1 ? 1 : threads;
#pragma omp parallel for schedule(dynamic) num_threads(outer) if (outer > 1)
    for (size_t i = 0; i < n; i++) {
        if (results[i].source != SDM_SOURCE_NETWORK) continue;
        sdm_error e;
        const sdm_status s = sdm_check_result(&info->grid, used + i * info->n_params, o, inner,
                                              values + i * voxels, &results[i], &e);
        if (s) {
#pragma omp critical(sdm_check_results)
            first_error_keep(&first, i, s, &e);
        }
    }
    if (!first.err.status) return SDM_OK;
    if (err) *err = first.err;
    return n > 1 ? sdm_fail_in(err, first.err.status, "map %zu of %zu", first.index, n)
                 : first.err.status;
}
