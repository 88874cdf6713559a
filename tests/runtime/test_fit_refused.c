/* Fits that must fail: images without the shape, wrong arguments, failing allocations,
 * cancellation. Also start poses from points and axes.
 * Tests: start_pose.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"
#include "sdm/internal/heap.h"

static void fit_refused(sdm_status wanted, const char *text, const sdm_fit_target *t,
                        const sdm_fit_opts *o)
{
    const sdm_fit_source source = exact_source();
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, t, o, &r, &err);
    if (s != wanted || !strstr(err.text, text))
        fail_msg("%s: %s; wanted: %s", sdm_status_name(s), err.text, text);
    assert_true(s == SDM_E_QUALITY || !r.params);
    sdm_fit_dispose(&r);
}

static void test_image_without_shape_is_refused(void **state)
{
    (void)state;
    const sdm_grid g = image_grid();
    const size_t n = sdm_grid_count(&g);
    float *v = calloc(n, sizeof *v);
    if (!v) abort();
    sdm_fit_target t = image_of(v);
    const sdm_fit_opts o = near_start();
    fit_refused(SDM_E_QUALITY, "every voxel is 0", &t, &o);
    for (size_t i = 0; i < n; i++) v[i] = NAN;
    fit_refused(SDM_E_FORMAT, "are NaN", &t, &o);
    for (size_t i = 0; i < n; i++) v[i] = (float)(700 + 300 * sdm_rng_normal(1, 2, i));
    fit_refused(SDM_E_QUALITY, "no such shape", &t, &o);
    free(v);
    v = phantom(TRUTH, &POSE, 1, 5);
    for (size_t i = 0; i < n; i++) v[i] = 1340 - v[i]; // opposite contrast
    t.values = v;
    const sdm_fit_source source = exact_source();
    sdm_fit_result r;
    sdm_error err;
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_QUALITY);
    assert_true(strstr(err.text, "opposite") || strstr(err.text, "no such shape") ||
                strstr(err.text, "lies in the image"));
    sdm_fit_dispose(&r);
    free(v);
}

// A failed fit returns its start and the reason of the failure.
static void test_failed_fit_returns_its_start(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_opts o = near_start();
    sdm_fit_source source = exact_source();
    // The shape lies outside of the grid of its maps.
    source.grid.origin[0] += 50;
    sdm_fit_result r;
    sdm_error err = {0};
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_QUALITY);
    assert_memory_equal(r.params, START, sizeof START);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(r.pose.rotation[k] - o.start_pose.rotation[k]) < 1e-12);
    assert_memory_equal(r.pose.translation, o.start_pose.translation, sizeof r.pose.translation);
    assert_true(isnan(r.evidence) && isnan(r.log_likelihood_without) && !r.converged);
    // 0 would mean that it is known exactly
    for (int k = 0; k < 9; k++) assert_true(isnan(r.sd[k]));
    for (int k = 0; k < 81; k++) assert_true(isnan(r.covariance[k]) && isnan(r.correlation[k]));
    assert_true(isnan(r.inside_share) && isnan(r.noise_factor) && isnan(r.model_error_mm));
    if (!*r.reason || strncmp(r.reason, err.text, 200) != 0) fail_msg("reason '%s'", r.reason);
    sdm_fit_dispose(&r);
    free(v);
}

static bool stop(void *user) { return --*(int *)user < 0; }

static void test_bad_arguments_and_cancellation(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.start_pose.translation[0] = 100;
    fit_refused(SDM_E_ARG, "no voxel of the image", &t, &o);
    o = near_start();
    o.start_params = (const double[3]){2, 2, 9};
    fit_refused(SDM_E_RANGE, "start: parameter 'rz' = 9", &t, &o);
    o = near_start();
    o.max_iterations = 1;
    fit_refused(SDM_E_QUALITY, "not converged after 2 iterations", &t, &o);
    o = near_start();
    o.l_ref = NAN;
    fit_refused(SDM_E_ARG, "l_ref", &t, &o);
    o = near_start();
    o.blur = 1e9;
    fit_refused(SDM_E_ARG, "blur of 1e+09 mm spreads over 4e+09 voxels", &t, &o);
    o.cavity = 3;
    fit_refused(SDM_E_ARG, "blur of 1e+09 mm spreads over", &t, &o);
    o = near_start();
    o.image_model = SDM_FIT_LABELS;
    o.l_ref = 1e9;
    fit_refused(SDM_E_ARG, "l_ref of 1e+09 mm spreads over", &t, &o);
    o = near_start();
    o.blur = 0.1;
    o.keep_blur = true;
    fit_refused(SDM_E_ARG,
                "a blur of 0.1 mm is kept, but maps with voxels of 0.25 mm carry one of 0.125 mm",
                &t, &o);
    o = near_start();
    o.tissue_mm = -1;
    fit_refused(SDM_E_ARG, "tissue_mm", &t, &o);
    o = near_start();
    o.appearance.inside[0].sd = 0;
    fit_refused(SDM_E_ARG, "sd of law 0 inside", &t, &o);
    o = near_start();
    o.keep_params = o.keep_pose = true;
    fit_refused(SDM_E_ARG, "nothing to fit", &t, &o);
    for (int calls = 0; calls < 60; calls += 13) {
        int left = calls;
        o = near_start();
        o.cancelled = stop;
        o.user = &left;
        fit_refused(SDM_E_CANCELLED, "", &t, &o);
    }
    v[36 * 30 * 13 + 36 * 15 + 18] = INFINITY;
    o = near_start();
    fit_refused(SDM_E_FORMAT, "infinite", &t, &o);
    v[36 * 30 * 13 + 36 * 15 + 18] = NAN;
    sdm_fit_result r = fit(&t, &o);
    assert_int_equal(r.n_nan, 1);
    sdm_fit_dispose(&r);
    // Half of the image is missing: the share of the shape that is left suffices for the default
    // least_inside, but not for 0.7.
    for (size_t i = 0; i < 36 * 30 * 26; i++)
        if (i % 36 < 20) v[i] = NAN;
    o.least_inside = 0.7;
    fit_refused(SDM_E_QUALITY, "of the shape lies in the image", &t, &o);
    free(v);

    sdm_fit_result none;
    assert_int_equal(sdm_fit(&(sdm_fit_source){0}, &t, &o, &none, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit(NULL, &t, &o, &none, NULL), SDM_E_ARG);
    const sdm_fit_source source = exact_source();
    assert_int_equal(sdm_fit(&source, NULL, &o, &none, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit(&source, &t, &o, NULL, NULL), SDM_E_ARG);
}

// The n-th allocation fails: an error, and no leak (detected by the sanitizer build).
static void test_each_allocation_may_fail(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0, 5);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_source source = exact_source();
    const sdm_fit_opts o = near_start();
    size_t failed = 0;
    for (unsigned long n = 1; n < 700; n += n < 30 ? 1 : n) {
        sdm_fit_result r;
        sdm_error err = {0};
        sdm_alloc_fail_after(n);
        const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
        sdm_alloc_fail_after(0);
        if (s && s != SDM_E_NOMEM) fail_msg("%s: %s", sdm_status_name(s), err.text);
        failed += s == SDM_E_NOMEM && !r.params && !r.covariance;
        assert_true(!s || !r.params);
        sdm_fit_dispose(&r);
    }
    assert_true(failed > 30);
    free(v);
}

static void test_start_poses(void **state)
{
    (void)state;
    const double shape[12] = {0, 0, 0, 1, 0, 0, 0, 2, 0, 0, 0, 3};
    double world[12];
    sdm_pose pose;
    for (int i = 0; i < 4; i++) sdm_pose_apply(&POSE, shape + 3 * i, world + 3 * i);
    for (size_t n = 2; n <= 4; n++) {
        assert_int_equal(sdm_fit_pose_from_points(shape, world, n, &pose, NULL), SDM_OK);
        for (size_t i = 0; i < n; i++) {
            double x[3];
            sdm_pose_apply(&pose, shape + 3 * i, x);
            for (size_t k = 0; k < 3; k++) assert_true(fabs(x[k] - world[3 * i + k]) < 1e-12);
        }
        for (int k = 0; k < 3 && n > 2; k++)
            assert_true(fabs(pose.rotation[k] - POSE.rotation[k]) < 1e-12);
    }
    assert_int_equal(sdm_fit_pose_from_points(shape, world, 1, &pose, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit_pose_from_points((double[6]){0}, world, 2, &pose, NULL), SDM_E_ARG);

    const double point[3] = {0.5, -0.2, 0.3}, centre[3] = {4, 5, 6};
    const double axes[4][3] = {{0, 0, 2}, {0, 0, -1}, {1, 2, -3}, {1e-3, 0, 0}};
    for (int i = 0; i < 4; i++) {
        double a[3], b[3];
        assert_int_equal(sdm_fit_pose_from_axis(point, centre, axes[i], &pose, NULL), SDM_OK);
        sdm_pose_apply(&pose, point, a);
        sdm_pose_apply(&pose, (const double[3]){point[0], point[1], point[2] + 1}, b);
        const double length =
            sqrt(axes[i][0] * axes[i][0] + axes[i][1] * axes[i][1] + axes[i][2] * axes[i][2]);
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(a[k] - centre[k]) < 1e-12);
            assert_true(fabs(b[k] - a[k] - axes[i][k] / length) < 1e-12);
        }
    }
    assert_int_equal(sdm_fit_pose_from_axis(point, centre, (double[3]){0, 0, 0}, &pose, NULL),
                     SDM_E_ARG);

    const sdm_fit_source source = exact_source();
    double middle[3];
    assert_int_equal(sdm_fit_centre(&source, TRUTH, middle, NULL), SDM_OK);
    for (int k = 0; k < 3; k++) assert_true(fabs(middle[k]) < 0.05);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_image_without_shape_is_refused),
                                       cmocka_unit_test(test_bad_arguments_and_cancellation),
                                       cmocka_unit_test(test_failed_fit_returns_its_start),
                                       cmocka_unit_test(test_start_poses),
                                       cmocka_unit_test(test_each_allocation_may_fail)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
