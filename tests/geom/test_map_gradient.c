/* The gradient of a map by second-order differences: exact for quadratic functions; elsewhere close
 * to the exact engine's normals.
 * Tests: map_gradient.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/exact_tools.h"
#include "sdm/map.h"

// A grid with anisotropic voxels, rotated about two axes and reflected.
static sdm_grid oblique_grid(int64_t nx, int64_t ny, int64_t nz, double h)
{
    const double a = 0.4, b = -0.7;
    return (sdm_grid){.n = {nx, ny, nz},
                      .origin = {-1, -2, 1.5},
                      .spacing = {h, 0.5 * h, 2 * h},
                      .dir = {cos(a), -sin(a) * cos(b), -sin(a) * sin(b), sin(a), cos(a) * cos(b),
                              cos(a) * sin(b), 0, sin(b), -cos(b)}};
}

static float *gradient_of(const sdm_grid *g, const float *values)
{
    float *gradient = room(3 * sdm_grid_count(g), sizeof *gradient);
    sdm_error err = {0};
    if (sdm_map_gradient(g, values, 1, gradient, &err)) fail_msg("%s", err.text);
    return gradient;
}

static void test_plane_is_exact(void **state)
{
    (void)state;
    const double normal[3] = {0.48, -0.6, 0.64};
    const int64_t sizes[][3] = {{9, 7, 8}, {2, 2, 2}, {3, 2, 5}};
    for (size_t k = 0; k < 3; k++) {
        const sdm_grid g = oblique_grid(sizes[k][0], sizes[k][1], sizes[k][2], 0.3);
        const size_t n = sdm_grid_count(&g);
        float *values = room(n, sizeof *values);
        for (size_t i = 0; i < n; i++) {
            double x[3];
            position(&g, i, x);
            values[i] = (float)(normal[0] * x[0] + normal[1] * x[1] + normal[2] * x[2] + 0.2);
        }
        float *gradient = gradient_of(&g, values);
        for (size_t i = 0; i < 3 * n; i++)
            assert_true(fabs((double)gradient[i] - normal[i / n]) < 1e-5);
        free(gradient);
        free(values);
    }
}

// A quadratic function: exact also at the border. An axis with a single voxel has no derivative.
static void test_quadratic_is_exact(void **state)
{
    (void)state;
    const sdm_grid g = oblique_grid(6, 5, 4, 0.3),
                   line =
                       sdm_grid_centred((const int64_t[]){5, 1, 1}, 0.5, (const double[]){1, 2, 3});
    const size_t n = sdm_grid_count(&g);
    float *values = room(n, sizeof *values);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        position(&g, i, x);
        values[i] = (float)(x[0] * x[0] - 0.5 * x[1] * x[2]);
    }
    float *gradient = gradient_of(&g, values);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        position(&g, i, x);
        const double expected[3] = {2 * x[0], -0.5 * x[2], -0.5 * x[1]};
        for (size_t a = 0; a < 3; a++)
            assert_true(fabs((double)gradient[a * n + i] - expected[a]) < 2e-5);
    }
    free(gradient);
    free(values);
    const float squares[5] = {0, 1, 4, 9, 16};
    gradient = gradient_of(&line, squares);
    for (size_t i = 0; i < 5; i++)
        assert_true(fabs((double)gradient[i] - 4.0 * (double)i) < 1e-5 && gradient[5 + i] == 0 &&
                    gradient[10 + i] == 0);
    free(gradient);
}

// A grid centred at (3, 2, 3).
static sdm_grid corner_grid(int64_t n, double h)
{
    sdm_grid g = oblique_grid(n, n, n, h);
    const double middle[3] = {(double)(n - 1) / 2, (double)(n - 1) / 2, (double)(n - 1) / 2},
                 wanted[3] = {3, 2, 3};
    double x[3];
    sdm_grid_world(&g, middle, x);
    for (int a = 0; a < 3; a++) g.origin[a] += wanted[a] - x[a];
    return g;
}

// The distance to a point: second order everywhere, so half the spacing gives a quarter of the
// error.
static void test_error_is_of_second_order(void **state)
{
    (void)state;
    double error[2] = {0, 0};
    for (int k = 0; k < 2; k++) {
        const sdm_grid g = corner_grid(7 + 6 * k, k ? 0.15 : 0.3); // the same corners for both
        const size_t n = sdm_grid_count(&g);
        float *values = room(n, sizeof *values);
        double x[3];
        for (size_t i = 0; i < n; i++) {
            position(&g, i, x);
            values[i] = (float)sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
        }
        float *gradient = gradient_of(&g, values);
        for (size_t i = 0; i < n; i++) {
            position(&g, i, x);
            const double r = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
            for (size_t a = 0; a < 3; a++)
                error[k] = fmax(error[k], fabs((double)gradient[a * n + i] - x[a] / r));
        }
        free(gradient);
        free(values);
    }
    assert_true(error[0] < 0.05 && error[1] > 0.15 * error[0] && error[1] < 0.35 * error[0]);
}

static void test_exact_normals(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, (const double[]){0, 0, 0}, 2, 100);
    sdm_exact *e = engine(&m, NULL);
    const sdm_grid g = corner_grid(12, 0.15);
    const size_t n = sdm_grid_count(&g);
    float *values = room(n, sizeof *values), *normal = room(3 * n, sizeof *normal);
    assert_int_equal(
        sdm_exact_map_layers(e, &g, &(sdm_exact_layers){.values = values, .normal = normal}, NULL),
        SDM_OK);
    float *gradient = gradient_of(&g, values);
    // Facets tilt the normals by up to half the angle between two of them, 0.016.
    for (size_t i = 0; i < n; i++)
        for (size_t a = 0; a < 3; a++)
            assert_true(fabs((double)gradient[a * n + i] - (double)normal[3 * i + a]) < 0.03);
    free(gradient);
    free(normal);
    free(values);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_threads_and_misuse(void **state)
{
    (void)state;
    sdm_grid g = oblique_grid(9, 8, 7, 0.3);
    const size_t n = sdm_grid_count(&g);
    float *values = room(n, sizeof *values), *again = room(3 * n, sizeof *again);
    for (size_t i = 0; i < n; i++) values[i] = sinf((float)i);
    float *first = gradient_of(&g, values);
    sdm_error err;
    for (int threads = 0; threads < 4; threads++) {
        memset(again, 0, 3 * n * sizeof *again);
        assert_int_equal(sdm_map_gradient(&g, values, threads, again, &err), SDM_OK);
        assert_memory_equal(again, first, 3 * n * sizeof *again);
    }
    assert_int_equal(sdm_map_gradient(NULL, values, 0, again, &err), SDM_E_ARG);
    assert_int_equal(sdm_map_gradient(&g, NULL, 0, again, &err), SDM_E_ARG);
    assert_int_equal(sdm_map_gradient(&g, values, 0, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_map_gradient(&g, values, -1, again, &err), SDM_E_ARG);
    g.n[1] = 0;
    assert_int_equal(sdm_map_gradient(&g, values, 0, again, &err), SDM_E_ARG);
    free(first);
    free(again);
    free(values);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plane_is_exact),           cmocka_unit_test(test_quadratic_is_exact),
        cmocka_unit_test(test_error_is_of_second_order), cmocka_unit_test(test_exact_normals),
        cmocka_unit_test(test_threads_and_misuse),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
