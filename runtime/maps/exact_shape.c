/* Exact maps and derivatives of a shape: parameters, mesh, exact engine. */
#include "shape_surface.h"

sdm_status sdm_exact_shape_map(const sdm_instance *shape, const double *p,
                               const sdm_exact_opts *opts, const sdm_grid *grid, float *values,
                               sdm_exact_report *report, sdm_error *err)
{
    if (!shape || !p || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "exact map: shape, parameters, grid and values are needed");
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    shape_surface surface = {0};
    s = sdm_shape_surface_make(shape, p, false, opts, &surface, err);
    if (!s) s = sdm_exact_map(surface.engine, grid, values, err);
    if (!s && report) *report = *sdm_exact_get_report(surface.engine);
    sdm_shape_surface_dispose(&surface);
    return s;
}

sdm_status sdm_exact_shape_jacobian(const sdm_instance *shape, const double *p,
                                    const sdm_exact_opts *opts, const sdm_grid *grid, float *values,
                                    float *jacobian, sdm_exact_report *report, sdm_error *err)
{
    if (!shape || !p || !grid || !jacobian)
        return sdm_fail(err, SDM_E_ARG,
                        "exact derivatives: shape, parameters, grid and jacobian are needed");
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    shape_surface surface = {0};
    const sdm_exact_layers layers = {.values = values};
    s = sdm_shape_surface_make(shape, p, true, opts, &surface, err);
    if (!s)
        s = sdm_exact_map_derivative(surface.engine, grid, surface.velocity, surface.n_params,
                                     &layers, jacobian, err);
    if (!s && report) *report = *sdm_exact_get_report(surface.engine);
    sdm_shape_surface_dispose(&surface);
    return s;
}
