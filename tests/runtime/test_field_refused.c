/* Fields out of the trained range, maps with too large an error, wrong arguments and failing
 * allocations.
 * Tests: field.c generate_field.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/field_scene.h"
#include "sdm/internal/heap.h"

static void test_policies_out_of_range(void **state)
{
    const scene *s = *state;
    const double p[2] = {1.7, 0.5}, edge[2] = {1.5, 0.5};
    const sdm_grid m = model_grid(false), g = case_grid(&m, &cases[1]);
    const size_t n = sdm_grid_count(&g);
    float *values = malloc(2 * n * sizeof *values), *wanted = values + n, slopes[2];
    sdm_result r;
    sdm_error err;
    assert_int_equal(sdm_generate_grid(s->model[0], p, NULL, &g, values, NULL, &r, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "'radius' = 1.7 mm"));
    const sdm_generate_opts clamp = {.policy = SDM_RANGE_CLAMP},
                            exact = {.policy = SDM_RANGE_EXACT, .exact_shape = s->shape};
    assert_false(sdm_generate_grid(s->model[0], p, &clamp, &g, values, NULL, &r, &err));
    assert_false(sdm_generate_grid(s->model[0], edge, NULL, &g, wanted, NULL, NULL, &err));
    assert_true(r.clamped && same(values, wanted, n));
    // exact values on the grid and at points
    assert_false(sdm_generate_grid(s->model[0], p, &exact, &g, values, NULL, &r, &err));
    assert_false(sdm_exact_shape_map(s->shape, p, NULL, &g, wanted, NULL, &err));
    assert_true(r.source == SDM_SOURCE_EXACT && same(values, wanted, n));
    const double x[3] = {5, 0, 0};
    assert_false(
        sdm_generate_points(s->model[0], p, &exact, x, 1, values, wanted, slopes, &r, &err));
    assert_true(fabs((double)slopes[0] + 1) < 5e-3 && fabs((double)slopes[1] + 0.1) < 5e-4);
    assert_true(r.source == SDM_SOURCE_EXACT);
    assert_true(fabs((double)values[0] - 3.25) < 5e-3 && fabs((double)wanted[0] - 1) < 0.05);
    sdm_blocks band;
    if (sdm_generate_band(s->model[0], p, &exact, &m, 1, &band, &r, &err)) fail_msg("%s", err.text);
    static float map[BALL_VOXELS], whole[BALL_VOXELS];
    blocks_map(&band, map);
    assert_false(sdm_exact_shape_map(s->shape, p, NULL, &m, whole, NULL, &err));
    for (size_t v = 0; v < sdm_grid_count(&m); v++)
        assert_true(map[v] == fmaxf(-1, fminf(whole[v], 1)));
    sdm_blocks_dispose(&band);
    free(values);
}

static void test_check_on_a_grid(void **state)
{
    const scene *s = *state;
    const sdm_grid m = model_grid(false);
    sdm_grid g = m;
    for (int a = 0; a < 3; a++) g.n[a] = 2 * m.n[a] - 1, g.spacing[a] /= 2;
    const size_t n = sdm_grid_count(&g);
    float *values = malloc(4 * n * sizeof *values), *exact = values + n, *slopes = exact + n;
    sdm_result r;
    sdm_error err;
    sdm_generate_opts o = {.check = true, .exact_shape = s->shape};
    assert_false(sdm_generate_grid(s->model[0], params, &o, &g, values, NULL, &r, &err));
    assert_true(r.checked && r.check.used == SDM_CHECK_POINTS && r.check.max_mm > 0.01);
    o.max_error_mm = 1e-3; // the ripple is no ball
    assert_int_equal(sdm_generate_grid(s->model[0], params, &o, &g, values, NULL, &r, &err),
                     SDM_E_QUALITY);
    o.policy = SDM_RANGE_EXACT;
    assert_false(sdm_generate_grid(s->model[0], params, &o, &g, values, slopes, &r, &err));
    assert_false(sdm_exact_shape_map(s->shape, params, NULL, &g, exact, NULL, &err));
    assert_true(r.reason == SDM_REASON_ERROR && same(values, exact, n));
    assert_false(sdm_exact_shape_jacobian(s->shape, params, NULL, &g, NULL, values, NULL, &err));
    assert_true(same(slopes, values, n));
    free(values);
}

static void refuse_grid(const scene *s, const sdm_grid *g, const char *what)
{
    float value[1];
    sdm_blocks band;
    sdm_error err;
    assert_int_equal(sdm_generate_grid(s->model[0], params, NULL, g, value, NULL, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, what));
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, g, 1, &band, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, what));
}

static void test_wrong_arguments_are_refused(void **state)
{
    const scene *s = *state;
    const sdm_grid good = model_grid(false);
    sdm_grid g = good;
    g.spacing[1] = 0;
    refuse_grid(s, &g, "spacing along y is 0 mm");
    g = good, g.origin[2] = NAN;
    refuse_grid(s, &g, "origin along z");
    g = good, g.dir[1] = 0.1;
    refuse_grid(s, &g, "not orthonormal");
    g = good, g.n[0] = 0;
    refuse_grid(s, &g, "size along x is 0");
    // a band with too many blocks, too narrow
    sdm_blocks band;
    sdm_error err;
    g = good;
    for (int a = 0; a < 3; a++) g.n[a] = 1 << 15, g.spacing[a] = 1e-6;
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, &g, 1, &band, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, "use larger voxels"));
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, &good, 0.3, &band, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, "band of 0.3 mm"));
    // points and fields
    const double bad[6] = {0, 0, 0, 0, NAN, 0};
    float values[4], slopes[4];
    assert_int_equal(
        sdm_generate_points(s->model[0], params, NULL, bad, 2, values, NULL, NULL, NULL, &err),
        SDM_E_ARG);
    assert_non_null(strstr(err.text, "point 2 of 2"));
    assert_int_equal(
        sdm_generate_points(s->model[0], params, NULL, bad, 2, NULL, NULL, NULL, NULL, &err),
        SDM_E_ARG);
    assert_non_null(strstr(err.text, "sdm_generate_points: the points x and an array values[n]"));
    assert_int_equal(sdm_field_points(NULL, bad, 1, values, NULL, NULL, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "sdm_field_points: the field f"));
    sdm_field *f;
    const sdm_generate_opts check = {.check = true, .exact_shape = s->shape};
    assert_int_equal(sdm_field_create(s->model[0], &check, false, &f, &err), SDM_E_ARG);
    const sdm_generate_opts unknown = {.outside = (sdm_outside)7};
    assert_int_equal(sdm_field_create(s->model[0], &unknown, false, &f, &err), SDM_E_ARG);
    const sdm_generate_opts shapeless = {.outside = SDM_OUTSIDE_EXACT};
    assert_int_equal(sdm_field_create(s->model[0], &shapeless, false, &f, &err), SDM_E_ARG);
    assert_false(sdm_field_create(s->model[0], NULL, false, &f, &err));
    assert_int_equal(sdm_field_point(f, bad, values, NULL, NULL, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "sdm_field_set_params() comes first"));
    assert_false(sdm_field_set_params(f, params, NULL, &err));
    assert_int_equal(sdm_field_point(f, bad, values, NULL, slopes, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "without derivatives"));
    const double wild[2] = {NAN, 0};
    assert_int_equal(sdm_field_set_params(f, wild, NULL, &err), SDM_E_RANGE);
    assert_int_equal(sdm_field_point(f, bad, values, NULL, NULL, &err), SDM_E_ARG);
    sdm_field_free(f);
    sdm_field_free(NULL);
}

static void test_each_allocation_may_fail(void **state)
{
    const scene *s = *state;
    const sdm_grid m = model_grid(false), g = case_grid(&m, &cases[4]);
    const sdm_generate_opts o = {.n_threads = 1};
    float values[280], slopes[560];
    sdm_error err;
    unsigned long failures = 0;
    for (unsigned long i = 1, failing = 1; failing; i++) {
        sdm_blocks band;
        sdm_alloc_fail_after(i);
        const sdm_status a =
            sdm_generate_grid(s->model[0], params, &o, &g, values, slopes, NULL, &err);
        sdm_alloc_fail_after(i);
        const sdm_status b = sdm_generate_band(s->model[0], params, &o, &g, 0.7, &band, NULL, &err);
        sdm_alloc_fail_after(0);
        assert_true(!a || a == SDM_E_NOMEM);
        assert_true(!b || b == SDM_E_NOMEM);
        if (b) assert_true(!band.values && !band.tile);
        sdm_blocks_dispose(&band);
        failing = a || b;
        failures += failing;
    }
    assert_true(failures > 8);
}

/* The same for slopes of exact distances at a point. */
static void test_each_allocation_of_exact_slopes_may_fail(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts o = {
        .policy = SDM_RANGE_EXACT, .exact_shape = s->shape, .n_threads = 1};
    const double p[2] = {1.7, 0.5}, x[3] = {5, 0, 0};
    float value, slopes[2];
    sdm_error err;
    sdm_status status = SDM_E_NOMEM;
    unsigned long i = 1;
    for (; status; i++) {
        sdm_alloc_fail_after(i);
        status = sdm_generate_points(s->model[0], p, &o, x, 1, &value, NULL, slopes, NULL, &err);
        sdm_alloc_fail_after(0);
        assert_true(!status || status == SDM_E_NOMEM);
    }
    assert_true(i > 20 && fabs((double)slopes[0] + 1) < 5e-3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_policies_out_of_range),
        cmocka_unit_test(test_check_on_a_grid),
        cmocka_unit_test(test_wrong_arguments_are_refused),
        cmocka_unit_test(test_each_allocation_may_fail),
        cmocka_unit_test(test_each_allocation_of_exact_slopes_may_fail),
    };
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
