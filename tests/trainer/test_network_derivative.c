/* Derivatives of a trained network against those of the exact engine, which computes them from the
 * motion of the surface.
 * Tests: jacobian.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/train.h"
#include "sdm/runtime.h"

static sdm_registry *registry;
static sdm_instance *torus;
static char folder[] = "derivative_XXXXXX";

static const char text[] = "shape: {name: torus}\n"
                           "grid: {size: [24, 24, 12], spacing: 0.5}\n"
                           "network: {kind: pod, depth: 2, width: 48, rank: 12, block: 4, levels: "
                           "2, modes: 64, degree: 6}\n"
                           "data: {static: 5, start: 200, online: 0, holdout: 20, memory_gb: 0.5}\n"
                           "train: {steps: 800, batch: 64, refine: 0}\n";

// Returns the root mean square of a - b; *size: that of b.
static double rms_difference(const float *a, const float *b, size_t n, double *size)
{
    double d = 0, s = 0;
    for (size_t i = 0; i < n; i++) {
        d += ((double)a[i] - b[i]) * ((double)a[i] - b[i]);
        s += (double)b[i] * b[i];
    }
    *size = sqrt(s / (double)n);
    return sqrt(d / (double)n);
}

static void jacobian_agrees_with_the_exact_engine(void **state)
{
    (void)state;
    sdm_config c;
    sdm_error e = {0};
    sdm_train_report r;
    sdm_model *m;
    if (sdm_config_parse("test.yaml", text, sizeof text - 1, NULL, 0, &c, &e))
        fail_msg("%s", e.text);
    if (sdm_train(&c, torus, folder, false, NULL, &r, &e)) fail_msg("%s", e.text);
    if (sdm_model_open(r.model_path, &m, &e)) fail_msg("%s", e.text);
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t n = sdm_grid_count(&info->grid), n_params = info->n_params;
    assert_int_equal(n_params, 2);
    float *map = malloc(n * sizeof *map), *j = malloc(n * n_params * sizeof *j),
          *truth = malloc(n * sizeof *truth), *j_truth = malloc(n * n_params * sizeof *j_truth);
    assert_true(map && j && truth && j_truth);
    for (uint64_t k = 0; k < 5; k++) {
        double p[2], size;
        for (size_t i = 0; i < n_params; i++)
            p[i] = info->params[i].min +
                   (0.13 + 0.17 * (double)k) * (info->params[i].max - info->params[i].min);
        if (sdm_generate_jacobian(m, p, NULL, map, j, NULL, &e)) fail_msg("%s", e.text);
        if (sdm_exact_shape_jacobian(torus, p, NULL, &info->grid, truth, j_truth, NULL, &e))
            fail_msg("%s", e.text);
        for (size_t i = 0; i < n_params; i++) {
            const double off = rms_difference(j + i * n, j_truth + i * n, n, &size);
            assert_true(size > 0.5 && off < 0.05 * size);
        }
        // The gradient of a weighted sum of the voxels (weights in map), by sdm_generate_vjp().
        double gradient[2], expected[2] = {0}, scale[2] = {0};
        for (size_t v = 0; v < n; v++) map[v] = (float)(v % 7) - 2.0f;
        if (sdm_generate_vjp(m, p, map, NULL, gradient, NULL, &e)) fail_msg("%s", e.text);
        for (size_t i = 0; i < n_params; i++) {
            for (size_t v = 0; v < n; v++) {
                expected[i] += (double)map[v] * j_truth[i * n + v];
                scale[i] += fabs((double)map[v] * j_truth[i * n + v]);
            }
            assert_true(fabs(gradient[i] - expected[i]) < 0.002 * scale[i]);
        }
    }
    free(j_truth);
    free(truth);
    free(j);
    free(map);
    sdm_model_free(m);
}

// As sdm/runtime.h states for byte weights: the map computed without derivatives is rounded more
// coarsely than the one computed with them, and derivatives are close to those of float weights.
static void rounding_to_bytes_is_small(void **state)
{
    (void)state;
    char path[128];
    sdm_error e = {0};
    sdm_model *m;
    snprintf(path, sizeof path, "%s/model.sdm", folder);
    if (sdm_model_open(path, &m, &e)) fail_msg("%s", e.text);
    const sdm_model_info *info = sdm_model_get_info(m);
    const size_t n = sdm_grid_count(&info->grid), n_params = info->n_params;
    float *map = malloc(n * sizeof *map), *alone = malloc(n * sizeof *alone),
          *j = malloc(n * n_params * sizeof *j), *adjoint = calloc(n, sizeof *adjoint);
    assert_true(map && alone && j && adjoint && n_params == 2);
    for (uint64_t k = 0; k < 20; k++) {
        double p[2], gradient[2], most[2] = {0}, wrong = 0, size;
        for (size_t i = 0; i < n_params; i++)
            p[i] = info->params[i].min +
                   sdm_rng_uniform(9, k, i) * (info->params[i].max - info->params[i].min);
        if (sdm_generate(m, p, NULL, alone, NULL, &e)) fail_msg("%s", e.text);
        if (sdm_generate_jacobian(m, p, NULL, map, j, NULL, &e)) fail_msg("%s", e.text);
        for (size_t v = 0; v < n; v++) wrong = fmax(wrong, fabs((double)map[v] - alone[v]));
        const double square = rms_difference(map, alone, n, &size);
        assert_true(square > 0 && square < 3e-4 && wrong < 2e-3);
        for (size_t i = 0; i < n_params; i++)
            for (size_t v = 0; v < n; v++) most[i] = fmax(most[i], fabsf(j[i * n + v]));
        for (size_t v = k; v < n; v += 37) {
            adjoint[v] = 1;
            if (sdm_generate_vjp(m, p, adjoint, NULL, gradient, NULL, &e)) fail_msg("%s", e.text);
            adjoint[v] = 0;
            for (size_t i = 0; i < n_params; i++)
                assert_true(fabs(gradient[i] - j[i * n + v]) < 1.5e-3 * most[i]);
        }
    }
    free(adjoint);
    free(j);
    free(alone);
    free(map);
    sdm_model_free(m);
}

static int set_up(void **state)
{
    (void)state;
    if (!mkdtemp(folder) || sdm_registry_create(&registry, NULL) ||
        sdm_builtin_shapes_add(registry, NULL))
        return 1;
    return sdm_instance_create(sdm_registry_find(registry, "torus", NULL), NULL, 0, NULL, &torus,
                               NULL) != SDM_OK;
}

static int tear_down(void **state)
{
    (void)state;
    static const char *const names[] = {"model.sdm", "checkpoint.sdmc", "metrics.jsonl",
                                        "config.yaml", "loss.png"};
    char path[128];
    for (size_t i = 0; i < sizeof names / sizeof *names; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        remove(path);
    }
    sdm_instance_free(torus);
    sdm_registry_free(registry);
    return rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(jacobian_agrees_with_the_exact_engine),
                                       cmocka_unit_test(rounding_to_bytes_is_small)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
