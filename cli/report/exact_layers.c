/* Checks the options of the layers of an exact map, computes the layers and writes them. */
#include "exact_layers.h"

#include <math.h>
#include <string.h>

#include "files.h"
#include "output.h"
#include "sdm/image.h"
#include "sdm/internal/heap.h"

enum { CLOSEST, NORMAL, TRIANGLE, JACOBIAN, N_LAYERS };

static const char *const names[N_LAYERS] = {"closest", "normal", "triangle", "jacobian"};

static const char *path_of(const cli_args *args, int layer)
{
    const char *const paths[N_LAYERS] = {args->closest, args->normal, args->triangle,
                                         args->jacobian};
    return paths[layer];
}

bool cli_layers_wanted(const cli_args *args)
{
    return args->closest || args->normal || args->triangle || args->jacobian;
}

double cli_layers_bytes(const cli_layers *l, const cli_args *args)
{
    const double per_voxel[N_LAYERS] = {12, 12, 4, 4 * (double)l->n_params};
    double sum = 0;
    for (int i = 0; i < N_LAYERS; i++)
        if (path_of(args, i)) sum += per_voxel[i];
    return sum;
}

sdm_status cli_layers_check(const cli_args *args, sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < args->outputs.n && !s; i++)
        s = cli_check_type(args->outputs.items[i], false, err);
    for (int i = 0; i < N_LAYERS && !s; i++) {
        const char *path = path_of(args, i);
        if (!path) continue;
        if (!cli_ends_with(path, ".npy"))
            s = sdm_fail(err, SDM_E_ARG, "--%s '%s': its name must end in .npy", names[i], path);
        else if (strcmp(args->method, "exact"))
            s = sdm_fail(err, SDM_E_ARG, "--%s needs --method exact", names[i]);
    }
    if (!s && args->narrow > 0 && strcmp(args->method, "exact"))
        s = sdm_fail(err, SDM_E_ARG, "--narrow needs --method exact");
    const double band = args->band > 0 ? args->band : 3;
    for (size_t i = 0; i < args->outputs.n && !s && args->narrow > 0 && !args->dense; i++) {
        if (cli_ends_with(args->outputs.items[i], ".vdb") && !(args->narrow > band))
            s = sdm_fail(
                err, SDM_E_ARG,
                "--narrow %g is too narrow for a level set with --band %g: need more than %g",
                args->narrow, band, band);
    }
    if (!s && args->jacobian && !args->shape)
        s = sdm_fail(err, SDM_E_ARG, "--jacobian needs --shape: a mesh file has no parameters");
    return s ? s : cli_check_files(args, NULL, err);
}

sdm_status cli_layers_velocity(cli_layers *l, bool wanted, const sdm_instance *shape,
                               const double *params, size_t n_vert, sdm_error *err)
{
    if (!wanted) return SDM_OK;
    (void)sdm_instance_params(shape, &l->n_params);
    size_t count;
    sdm_status s = sdm_mul(3 * n_vert, l->n_params, &count, err);
    if (!s) s = SDM_ALLOC(&l->velocity, count, "velocities of the vertices", err);
    return s ? s : sdm_instance_velocity(shape, params, n_vert, l->velocity, err);
}

sdm_status cli_layers_map(cli_layers *l, const cli_args *args, const sdm_exact *engine,
                          const sdm_grid *grid, float *values, sdm_error *err)
{
    const size_t n = sdm_grid_count(grid);
    size_t count;
    sdm_status s = sdm_mul(n, l->n_params, &count, err);
    if (!s && args->closest) s = SDM_ALLOC(&l->arrays.closest, 3 * n, "closest points", err);
    if (!s && args->normal) s = SDM_ALLOC(&l->arrays.normal, 3 * n, "normals", err);
    if (!s && args->triangle) s = SDM_ALLOC(&l->arrays.triangle, n, "nearest triangles", err);
    if (!s && args->jacobian) s = SDM_ALLOC(&l->jacobian, count, "derivatives", err);
    if (s) return s;
    l->arrays.values = values;
    if (args->narrow > 0)
        l->arrays.band_mm =
            args->narrow * fmin(grid->spacing[0], fmin(grid->spacing[1], grid->spacing[2]));
    s = l->jacobian ? sdm_exact_map_derivative(engine, grid, l->velocity, l->n_params, &l->arrays,
                                               l->jacobian, err)
                    : sdm_exact_map_layers(engine, grid, &l->arrays, err);
    const uint32_t *source = sdm_exact_source(engine);
    // outside of a narrow band there is no nearest triangle: UINT32_MAX stays
    for (size_t i = 0; l->arrays.triangle && i < n && !s; i++)
        if (l->arrays.triangle[i] != UINT32_MAX)
            l->arrays.triangle[i] = source[l->arrays.triangle[i]];
    return s;
}

sdm_status cli_layers_write(const cli_layers *l, const cli_args *args, const sdm_grid *grid,
                            sdm_error *err)
{
    const size_t nx = (size_t)grid->n[0], ny = (size_t)grid->n[1], nz = (size_t)grid->n[2];
    const size_t scalar[3] = {nz, ny, nx}, vector[4] = {nz, ny, nx, 3},
                 per_param[4] = {l->n_params, nz, ny, nx};
    sdm_status s = SDM_OK;
    if (args->closest) s = sdm_npy_write(args->closest, l->arrays.closest, vector, 4, err);
    if (!s && args->normal) s = sdm_npy_write(args->normal, l->arrays.normal, vector, 4, err);
    if (!s && args->triangle)
        s = sdm_npy_write_uint32(args->triangle, l->arrays.triangle, scalar, 3, err);
    if (!s && args->jacobian) s = sdm_npy_write(args->jacobian, l->jacobian, per_param, 4, err);
    return s;
}

void cli_layers_dispose(cli_layers *l)
{
    sdm_free(l->arrays.closest);
    sdm_free(l->arrays.normal);
    sdm_free(l->arrays.triangle);
    sdm_free(l->jacobian);
    sdm_free(l->velocity);
    *l = (cli_layers){0};
}
