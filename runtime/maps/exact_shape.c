/* Exact maps and derivatives of a shape: parameters, mesh, exact engine. */
#include "sdm/internal/heap.h"
#include "sdm/runtime.h"

sdm_status sdm_exact_shape_map(const sdm_instance *shape, const double *p,
                               const sdm_exact_opts *opts, const sdm_grid *grid, float *values,
                               sdm_exact_report *report, sdm_error *err)
{
    if (!shape || !p || !grid || !values)
        return sdm_fail(err, SDM_E_ARG, "exact map: shape, parameters, grid and values are needed");
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    sdm_mesh mesh = {0};
    sdm_exact *engine = NULL;
    s = sdm_instance_mesh(shape, p, &mesh, err);
    if (!s) s = sdm_exact_create(&mesh, opts, &engine, err);
    if (!s) s = sdm_exact_map(engine, grid, values, err);
    if (!s && report) *report = *sdm_exact_get_report(engine);
    sdm_exact_free(engine);
    sdm_mesh_dispose(&mesh);
    return s;
}

/* *out = new array [n_params][n_vert][3]: derivative of each vertex by each parameter. */
static sdm_status vertex_velocities(const sdm_instance *shape, const double *p, size_t n_params,
                                    size_t n_vert, double **out, sdm_error *err)
{
    size_t count;
    sdm_status s = sdm_mul(3 * n_vert, n_params, &count, err);
    if (!s) s = SDM_ALLOC(out, count, "velocities of the vertices", err);
    return s ? s : sdm_instance_velocity(shape, p, n_vert, *out, err);
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
    sdm_mesh mesh = {0};
    double *velocity = NULL;
    sdm_exact *engine = NULL;
    size_t n_params;
    (void)sdm_instance_params(shape, &n_params);
    s = sdm_instance_mesh(shape, p, &mesh, err);
    if (!s) s = vertex_velocities(shape, p, n_params, mesh.n_vert, &velocity, err);
    if (!s) s = sdm_exact_create(&mesh, opts, &engine, err);
    const sdm_exact_layers layers = {.values = values};
    if (!s) s = sdm_exact_map_derivative(engine, grid, velocity, n_params, &layers, jacobian, err);
    if (!s && report) *report = *sdm_exact_get_report(engine);
    sdm_exact_free(engine);
    sdm_free(velocity);
    sdm_mesh_dispose(&mesh);
    return s;
}
