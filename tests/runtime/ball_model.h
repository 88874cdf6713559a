/* A ball of radius p[0] + 0.1 p[1] as a shape, and models whose networks represent its maps
 * exactly. Include cmocka.h first. */
#ifndef SDM_TEST_BALL_MODEL_H
#define SDM_TEST_BALL_MODEL_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/pod.h"
#include "sdm/memory.h"
#include "sdm/runtime.h"

enum { RINGS = 48, SECTORS = 96 };

#define UNLUCKY 0.123 // a bulge at which mesh() fails

static double ball_radius(const double *p) { return p[0] + 0.1 * p[1]; }

// ---- The shape: a fine sphere whose parameter ranges are wider than the network's.

static int mesh_ball(const void *self, const sdm_host *host, const sdm_option_value *options,
                     const double *p, sdm_mesh_out *out)
{
    (void)self;
    const double r = ball_radius(p) * options[0].number, pi = acos(-1.0);
    // In parentheses: cmocka defines a macro fail().
    if (p[1] == UNLUCKY) return (host->fail)(host, "an unlucky number");
    const int failed =
        host->reserve(host, out, 2 + (RINGS - 1) * SECTORS, 2 * (RINGS - 1) * SECTORS);
    if (failed) return failed;
    double *v = out->vert;
    for (int i = 1; i < RINGS; i++)
        for (int j = 0; j < SECTORS; j++, v += 3) {
            const double a = pi * i / RINGS, b = 2 * pi * j / SECTORS;
            v[0] = r * sin(a) * cos(b), v[1] = r * sin(a) * sin(b), v[2] = r * cos(a);
        }
    const uint32_t top = (RINGS - 1) * SECTORS, bottom = top + 1;
    v[0] = v[1] = v[3] = v[4] = 0, v[2] = r, v[5] = -r;
    uint32_t *t = out->tri;
    for (uint32_t j = 0; j < SECTORS; j++) {
        const uint32_t k = (j + 1) % SECTORS, last = (RINGS - 2) * SECTORS;
        const uint32_t ends[] = {top, j, k, bottom, last + k, last + j};
        memcpy(t, ends, sizeof ends);
        t += 6;
        for (uint32_t i = 0; i + 2 < RINGS; i++, t += 6) {
            const uint32_t a = i * SECTORS + j, b = i * SECTORS + k,
                           quad[] = {a, a + SECTORS, b, b, a + SECTORS, b + SECTORS};
            memcpy(t, quad, sizeof quad);
        }
    }
    return 0;
}

static const sdm_param shape_params[] = {{"radius", "mm", 0.5, 1.9, 1.2, "radius"},
                                         {"bulge", "", -2, 2, 0, "tenths of a mm more"}};
static const sdm_option shape_options[] = {
    {"scale", SDM_OPTION_REAL, "", 0.1, 10, 1, NULL, "factor of the radius"}};
static const sdm_shape ball_shape = {.abi = SDM_SHAPE_ABI,
                                     .size = sizeof(sdm_shape),
                                     .name = "ball",
                                     .summary = "a ball",
                                     .params = shape_params,
                                     .n_params = 2,
                                     .options = shape_options,
                                     .n_options = 1,
                                     .mesh = mesh_ball};

// ---- The model: its maps are |x| - 1.25 - (radius + 0.1 bulge - 1.25) mode(x) at the voxels of a
// grid; mode NULL: 1. One basis function for each block, coefficients linear in the parameters. A
// grid has at most BALL_VOXELS voxels.

enum { BALL_VOXELS = 17 * 17 * 17 };

// Volume, area and moment of the mesh at the default parameters that the model states; NaN: none.
static double ball_mesh_volume = NAN, ball_mesh_area = NAN, ball_mesh_moment = NAN;
// The same at its first probe.
static double ball_probe_volume = NAN, ball_probe_area = NAN, ball_probe_moment = NAN;

static void ball_model_bytes(const char *second_name, const sdm_grid *grid,
                             double (*mode)(const double x[3]), uint8_t **bytes, size_t *size)
{
    sdm_model_param params[2] = {
        {.name = "radius", .unit = "mm", .min = 1.0, .max = 1.5, .def = 1.2},
        {.min = -1, .max = 1}};
    snprintf(params[1].name, sizeof params[1].name, "%s", second_name);
    const char *const names[] = {"scale"}, *const option_values[] = {"1"};
    sdm_model_info info = {.shape = "ball",
                           .n_params = 2,
                           .params = params,
                           .n_options = 1,
                           .option_names = names,
                           .option_values = option_values,
                           .grid = *grid,
                           .accuracy = {.samples = 10, .rmse_mm = 0.0125},
                           .quality = {.cut = NAN, .between_mm = NAN, .thickness_mm = NAN},
                           .config = "shape: ball\n"};
    if (!isnan(ball_mesh_volume)) strcpy(info.quality.grade, "good");
    info.quality.mesh_volume_mm3 = ball_mesh_volume;
    info.quality.mesh_area_mm2 = ball_mesh_area;
    info.quality.probe_volume_mm3[0] = ball_probe_volume;
    info.quality.probe_area_mm2[0] = ball_probe_area;
    info.quality.mesh_moment_mm3 = ball_mesh_moment;
    info.quality.probe_moment_mm3[0] = ball_probe_moment;
    info.quality.probe_volume_mm3[1] = info.quality.probe_moment_mm3[1] = NAN;
    static sdm_pod_block blocks[BALL_VOXELS];
    sdm_pod_spec spec = {.info = &info, .blocks = blocks};
    spec.arch = (sdm_pod_arch){.n_params = 2,
                               .degree = 1,
                               .input_degree = 1,
                               .depth = 1,
                               .width = 8,
                               .block = 8,
                               .n_terms = sdm_poly_count(2, 1),
                               .n_inputs = sdm_poly_count(2, 1) - 1,
                               .n_voxels = sdm_grid_count(grid),
                               .levels = sdm_pod_count(&info.grid, 8, 1)};
    const size_t n_blocks = spec.arch.levels.first[1];
    spec.arch.n_latent = spec.arch.n_terms + spec.arch.width;
    spec.arch.n_coefficients = n_blocks;
    sdm_pod_blocks(&info.grid, 8, &spec.arch.levels, blocks);
    for (uint32_t b = 0; b < n_blocks; b++) blocks[b].rank = 1, blocks[b].coefficient = b;
    // Evaluate the polynomials of the two parameters, to find the order and scale of the terms.
    uint8_t table[6];
    float phi[3];
    sdm_poly_table(2, 1, table);
    sdm_poly_eval(table, 3, 2, 1, (const double[]){1, 1}, phi, NULL);
    static float head[64 * 16], map[BALL_VOXELS], mean[BALL_VOXELS], basis_map[BALL_VOXELS],
        basis[BALL_VOXELS], zero[64];
    assert_true(n_blocks <= 64 && spec.arch.n_latent <= 16);
    memset(head, 0, sizeof head);
    for (size_t b = 0; b < n_blocks; b++)
        for (size_t t = 0; t < 3; t++)
            head[b * spec.arch.n_latent + t] = table[2 * t]       ? -0.25f / phi[t]
                                               : table[2 * t + 1] ? -0.1f / phi[t]
                                                                  : 0;
    for (int64_t i = 0; i < (int64_t)sdm_grid_count(grid); i++) {
        double x[3];
        const int64_t nx = grid->n[0], ny = grid->n[1];
        sdm_grid_world(
            grid, (const double[]){(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)},
            x);
        map[i] = (float)(sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - 1.25);
        basis_map[i] = mode ? (float)mode(x) : 1;
    }
    sdm_pod_gather(&info.grid, blocks, n_blocks, map, mean);
    sdm_pod_gather(&info.grid, blocks, n_blocks, basis_map, basis);
    spec.weights = (sdm_pod_weights){
        .layer = {zero}, .bias = {zero}, .head = head, .mean = mean, .basis = basis};
    sdm_error err;
    if (sdm_pod_build(&spec, bytes, size, &err)) fail_msg("%s", err.text);
}

static inline sdm_model *ball_model(const char *second_name, const sdm_grid *grid,
                                    double (*mode)(const double x[3]))
{
    uint8_t *bytes = NULL;
    size_t size;
    sdm_error err;
    sdm_model *m = NULL;
    ball_model_bytes(second_name, grid, mode, &bytes, &size);
    if (sdm_model_open_memory("ball", bytes, size, &m, &err)) fail_msg("%s", err.text);
    sdm_free(bytes);
    return m;
}

#endif
