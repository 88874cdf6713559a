/* The check of a map against its mesh: error statistics that are known in closed form.
 * Tests: check.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "oracle/exact_tools.h"
#include "oracle/shape_registry.h"
#include "sdm/check.h"
#include "sdm/memory.h"
#include "sdm/runtime.h"

static const double centre[3] = {0.3, -0.2, 0.1};
static sdm_check check_of(const sdm_exact *e, const sdm_grid *g, const float *values)
{
    sdm_check c;
    sdm_error err = {0};
    if (sdm_check_map(e, g, values, &c, &err)) fail_msg("%s", err.text);
    return c;
}

// A grid centred at `centre` with anisotropic voxels, rotated about two axes and reflected.
static sdm_grid oblique_grid(int64_t n, double h)
{
    const double a = 0.4, b = -0.7;
    sdm_grid g = {.n = {n, n + 3, n + 5},
                  .spacing = {h, 0.9 * h, 1.1 * h},
                  .dir = {cos(a), -sin(a) * cos(b), -sin(a) * sin(b), sin(a), cos(a) * cos(b),
                          cos(a) * sin(b), 0, sin(b), -cos(b)}};
    const double middle[3] = {(double)(n - 1) / 2, (double)(n + 2) / 2, (double)(n + 4) / 2};
    double at[3];
    sdm_grid_world(&g, middle, at);
    for (int k = 0; k < 3; k++) g.origin[k] = centre[k] - at[k];
    return g;
}

// Exact maps have no error; with a constant added, every statistic is that constant.
static void test_exact_and_shifted(void **state)
{
    (void)state;
    const char *const names[] = {"cochlea", "ellipsoid", "torus"};
    for (size_t k = 0; k < 3; k++) {
        sdm_error err;
        sdm_instance *s = NULL;
        if (sdm_instance_create(sdm_registry_find(registry, names[k], NULL), NULL, 0, NULL, &s,
                                &err))
            fail_msg("%s", err.text);
        size_t n_params;
        const sdm_param *params = sdm_instance_params(s, &n_params);
        double p[8];
        for (size_t i = 0; i < n_params; i++) p[i] = params[i].def;
        const sdm_grid g = oblique_grid(34, 0.45);
        const size_t n = sdm_grid_count(&g);
        float *values = room(n, sizeof *values);
        sdm_check c;
        assert_int_equal(sdm_exact_shape_map(s, p, NULL, &g, values, NULL, &err), SDM_OK);
        assert_int_equal(sdm_check_shape(s, p, &g, values, &c, &err), SDM_OK);
        assert_int_equal(c.used, SDM_CHECK_POINTS);
        assert_int_equal(c.outside, 0);
        assert_true(c.max_mm < 1e-7 && c.rmse_mm <= c.max_mm && c.mean_mm <= c.rmse_mm &&
                    c.q95_mm <= c.max_mm);
        for (int sign = -1; sign <= 1; sign += 2) {
            float *shifted = room(n, sizeof *shifted);
            for (size_t i = 0; i < n; i++) shifted[i] = (float)((double)values[i] + 0.1 * sign);
            assert_int_equal(sdm_check_shape(s, p, &g, shifted, &c, &err), SDM_OK);
            for (int i = SDM_CHECK_MAX; i <= SDM_CHECK_MEAN; i++)
                assert_true(fabs(sdm_check_get(&c, (sdm_check_stat)i) - 0.1) < 1e-6);
            assert_true(fabs(c.bias_mm - 0.1 * sign) < 1e-6);
            free(shifted);
        }
        free(values);
        sdm_instance_free(s);
    }
}

// A sphere moved by d along an axis: errors on the surface are -d n_axis, and n_axis is uniform in
// -1 .. 1 (Archimedes) if points are drawn uniformly by area.
static void test_points_are_uniform_by_area(void **state)
{
    (void)state;
    const double d = 0.01, radius = 4;
    sdm_mesh m = {0};
    // Triangles near the poles are small: points drawn per triangle or vertex would accumulate
    // there.
    mesh_sphere(&m, centre, radius, 60);
    sdm_exact *e = engine(&m, NULL);
    const sdm_grid g = oblique_grid(60, 0.2);
    sdm_grid moved = g;
    const size_t n = sdm_grid_count(&g);
    float *values = room(n, sizeof *values);
    for (int axis = 0; axis < 3; axis++) {
        moved.origin[axis] = g.origin[axis] - d;
        assert_int_equal(sdm_exact_map(e, &moved, values, NULL), SDM_OK);
        moved.origin[axis] = g.origin[axis];
        const sdm_check c = check_of(e, &g, values);
        assert_true(fabs(c.mean_mm / d - 0.5) < 0.02 && fabs(c.rmse_mm / d - sqrt(1.0 / 3)) < 0.02);
        assert_true(fabs(c.q95_mm / d - 0.95) < 0.02 && c.max_mm / d > 0.98 &&
                    c.max_mm / d < 1.001);
        assert_true(fabs(c.bias_mm / d) < 0.03);
    }
    free(values);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

// An error of x_axis on the cube -1 .. 1, made of large triangles: |error| is 1 on two faces and
// uniform in 0 .. 1 on the other four.
static void test_points_are_uniform_in_triangles(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_box(&m, (const double[]){-1, -1, -1}, (const double[]){1, 1, 1});
    sdm_exact *e = engine(&m, NULL);
    const sdm_grid g =
        sdm_grid_centred((const int64_t[]){31, 31, 31}, 0.1, (const double[]){0, 0, 0});
    const size_t n = sdm_grid_count(&g);
    float *exact = room(n, sizeof *exact), *values = room(n, sizeof *values);
    assert_int_equal(sdm_exact_map(e, &g, exact, NULL), SDM_OK);
    for (int axis = 0; axis < 3; axis++) {
        for (size_t i = 0; i < n; i++) {
            double x[3];
            position(&g, i, x);
            values[i] = (float)((double)exact[i] + x[axis]);
        }
        const sdm_check c = check_of(e, &g, values);
        assert_true(fabs(c.mean_mm - 2.0 / 3) < 0.02 && fabs(c.rmse_mm - sqrt(5.0 / 9)) < 0.02);
        assert_true(fabs(c.bias_mm) < 0.03 && fabs(c.max_mm - 1) < 1e-6);
    }
    free(values);
    free(exact);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

// The map of a torus with a tube thicker by 0.1 mm.
static void test_error_of_wrong_parameter(void **state)
{
    (void)state;
    sdm_error err;
    sdm_instance *s = NULL;
    assert_int_equal(
        sdm_instance_create(sdm_registry_find(registry, "torus", NULL), NULL, 0, NULL, &s, &err),
        SDM_OK);
    size_t n_params;
    const sdm_param *params = sdm_instance_params(s, &n_params);
    double p[8];
    for (size_t i = 0; i < n_params; i++) p[i] = params[i].def;
    assert_int_equal(n_params, 2);
    const sdm_grid g = oblique_grid(40, 0.35);
    float *values = room(sdm_grid_count(&g), sizeof *values);
    assert_int_equal(sdm_exact_shape_map(s, p, NULL, &g, values, NULL, &err), SDM_OK);
    p[1] += 0.1;
    sdm_check c;
    assert_int_equal(sdm_check_shape(s, p, &g, values, &c, &err), SDM_OK);
    assert_true(fabs(c.mean_mm - 0.1) < 0.01 && fabs(c.bias_mm - 0.1) < 0.01 && c.max_mm < 0.12);
    free(values);
    sdm_instance_free(s);
}

// Surface inside of a union is not checked, and an inside-out mesh is treated as the exact engine
// does.
static void test_union_and_inside_out(void **state)
{
    (void)state;
    sdm_mesh m = {0}, b = {0};
    mesh_box(&m, (const double[]){-3, -2, -2}, (const double[]){1, 2, 2});
    mesh_box(&b, (const double[]){-1, -1.5, -1.5}, (const double[]){3, 1.5, 1.5});
    mesh_append(&m, &b);
    const sdm_grid g = oblique_grid(40, 0.3);
    float *values = room(sdm_grid_count(&g), sizeof *values);
    for (int turned = 0; turned < 2; turned++) {
        sdm_exact *e = engine(&m, NULL);
        assert_true(sdm_exact_get_report(e)->unioned && sdm_exact_get_report(e)->turned == turned);
        assert_int_equal(sdm_exact_map(e, &g, values, NULL), SDM_OK);
        const sdm_check c = check_of(e, &g, values);
        assert_true(c.used == SDM_CHECK_POINTS && c.max_mm < 1e-6);
        sdm_exact_free(e);
        mesh_flip(&m);
    }
    free(values);
    sdm_mesh_dispose(&m);
    sdm_mesh_dispose(&b);
}

// Points outside of the grid are counted; a NaN in the map makes the statistics fail any bound.
static void test_points_outside_and_nan(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, (const double[]){0, 0, 0}, 2, 60);
    sdm_exact *e = engine(&m, NULL);
    sdm_grid g = sdm_grid_centred((const int64_t[]){60, 60, 60}, 0.1, (const double[]){0, 0, 0});
    g.origin[2] = 0.05; // the grid begins at the equator
    const size_t n = sdm_grid_count(&g);
    float *values = room(n, sizeof *values);
    assert_int_equal(sdm_exact_map(e, &g, values, NULL), SDM_OK);
    sdm_check c = check_of(e, &g, values);
    assert_int_equal(c.used + c.outside, SDM_CHECK_POINTS);
    assert_in_range(c.used, SDM_CHECK_POINTS / 2 - 20, SDM_CHECK_POINTS / 2 + 20);
    assert_true(c.max_mm < 1e-6);
    for (size_t i = 0; i < n; i += 7) values[i] = NAN;
    c = check_of(e, &g, values);
    assert_true(isnan(c.max_mm) && isnan(c.mean_mm) && isnan(c.rmse_mm) && isnan(c.bias_mm));
    g.origin[2] = 50;
    c = check_of(e, &g, values);
    assert_true(c.used == 0 && c.outside == SDM_CHECK_POINTS);
    for (int i = SDM_CHECK_MAX; i <= SDM_CHECK_MEAN; i++)
        assert_true(isnan(sdm_check_get(&c, (sdm_check_stat)i)));
    free(values);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, (const double[]){0, 0, 0}, 2, 8);
    sdm_exact *e = engine(&m, NULL);
    sdm_grid g = sdm_grid_centred((const int64_t[]){2, 2, 2}, 1, (const double[]){0, 0, 0});
    const float values[8] = {0};
    sdm_check c;
    sdm_error err;
    assert_int_equal(sdm_check_map(NULL, &g, values, &c, &err), SDM_E_ARG);
    assert_int_equal(sdm_check_map(e, NULL, values, &c, &err), SDM_E_ARG);
    assert_int_equal(sdm_check_map(e, &g, NULL, &c, &err), SDM_E_ARG);
    assert_int_equal(sdm_check_map(e, &g, values, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_check_shape(NULL, &g.origin[0], &g, values, &c, &err), SDM_E_ARG);
    g.spacing[1] = 0;
    assert_int_equal(sdm_check_map(e, &g, values, &c, &err), SDM_E_ARG);
    assert_true(isnan(sdm_check_get(&c, (sdm_check_stat)4)));
    assert_string_equal(sdm_check_stat_name((sdm_check_stat)4), "unknown");
    assert_string_equal(sdm_check_stat_name(SDM_CHECK_Q95), "q95");
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exact_and_shifted),
        cmocka_unit_test(test_points_are_uniform_by_area),
        cmocka_unit_test(test_points_are_uniform_in_triangles),
        cmocka_unit_test(test_error_of_wrong_parameter),
        cmocka_unit_test(test_union_and_inside_out),
        cmocka_unit_test(test_points_outside_and_nan),
        cmocka_unit_test(test_wrong_arguments_are_refused),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
