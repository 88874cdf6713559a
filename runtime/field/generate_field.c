/* Grids, points and bands of a model at one parameter vector, by a field that is used once. */
#include "field_parts.h"
#include "maps/check_results.h"
#include "maps/generate_parts.h"

/* *out = a field at the parameters, for use on `grid` only unless that is NULL. */
static sdm_status open_field(const sdm_model *m, const double *params,
                             const sdm_generate_opts *opts, bool derivatives, const sdm_grid *grid,
                             sdm_field **out, sdm_result *result, sdm_error *err)
{
    *out = NULL;
    if (!m || !params)
        return sdm_fail(err, SDM_E_ARG, "generate: a model and parameters are needed");
    sdm_status s = sdm_field_create(m, opts, derivatives, out, err);
    // a grid in the box needs no exact engine
    if (!s && grid && !sdm_field_leaves(*out, grid)) (*out)->opts.outside = SDM_OUTSIDE_REFUSE;
    if (!s) s = sdm_field_set_params(*out, params, result, err);
    if (!s) return SDM_OK;
    sdm_field_free(*out);
    *out = NULL;
    return s;
}

/* Checks a map of the network on the grid, by the options; an exact map has exact derivatives. */
static sdm_status check_map(const sdm_field *f, const sdm_generate_opts *o, const sdm_grid *grid,
                            float *values, float *slopes, sdm_result *result, sdm_error *err)
{
    if (!sdm_wants_check(o) || result->source != SDM_SOURCE_NETWORK) return SDM_OK;
    const sdm_status s = sdm_check_result(grid, f->used, o, f->n_threads, values, result, err);
    if (s || !slopes || result->source == SDM_SOURCE_NETWORK) return s;
    const sdm_exact_opts exact = {.n_threads = o->n_threads};
    return sdm_exact_shape_jacobian(o->exact_shape, f->params, &exact, grid, values, slopes, NULL,
                                    err);
}

sdm_status sdm_generate_grid(const sdm_model *m, const double *params,
                             const sdm_generate_opts *opts, const sdm_grid *grid, float *values,
                             float *slopes, sdm_result *result, sdm_error *err)
{
    if (!m || !params || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "generate: model, parameters, grid and values are needed");
    sdm_generate_opts all;
    sdm_status s = sdm_generate_check_options(m, opts, &all, err);
    if (!s) s = sdm_grid_check(grid, err);
    if (s) return s;
    // the check is of the map on the grid, not of the field
    sdm_generate_opts unchecked = all;
    unchecked.check = false;
    unchecked.max_error_mm = 0;
    sdm_field *f;
    sdm_result found = {0};
    s = open_field(m, params, &unchecked, slopes != NULL, grid, &f, &found, err);
    if (!s) s = sdm_field_grid(f, grid, values, slopes, err);
    if (!s) s = check_map(f, &all, grid, values, slopes, &found, err);
    if ((!s || s == SDM_E_QUALITY) && result) {
        *result = found;
        result->cut = sdm_generate_is_cut(grid, values);
    }
    sdm_field_free(f);
    return s;
}

sdm_status sdm_generate_points(const sdm_model *m, const double *params,
                               const sdm_generate_opts *opts, const double *x, size_t n,
                               float *values, float *gradient, float *slopes, sdm_result *result,
                               sdm_error *err)
{
    if (n && (!x || !values))
        return sdm_fail(err, SDM_E_ARG,
                        "sdm_generate_points: the points x and an array values[n] must not be "
                        "NULL");
    sdm_field *f;
    sdm_status s = open_field(m, params, opts, slopes != NULL, NULL, &f, result, err);
    if (!s) s = sdm_field_points(f, x, n, values, gradient, slopes, err);
    sdm_field_free(f);
    return s;
}

sdm_status sdm_generate_band(const sdm_model *m, const double *params,
                             const sdm_generate_opts *opts, const sdm_grid *grid, double width,
                             sdm_blocks *out, sdm_result *result, sdm_error *err)
{
    if (!out) return sdm_fail(err, SDM_E_ARG, "generate: a place for the band is needed");
    *out = (sdm_blocks){0};
    sdm_field *f;
    sdm_status s = open_field(m, params, opts, false, NULL, &f, result, err);
    if (!s) s = sdm_field_band(f, grid, width, out, err);
    sdm_field_free(f);
    return s;
}
