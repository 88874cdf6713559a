/* Fits to phantoms with known truth: what is recovered, how honest the standard deviations are, what is refused. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"
#include "sdm/memory.h"

static sdm_fit_result fit(const sdm_fit_target *t, const sdm_fit_opts *o)
{
    const sdm_fit_source source = exact_source();
    sdm_fit_result r;
    sdm_error err = {0};
    if (sdm_fit(&source, t, o, &r, &err)) fail_msg("%s", err.text);
    return r;
}

// largest error of parameters (mm), turn (rad) and translation (mm)
static double worst(const sdm_fit_result *r)
{
    double e[9], most = 0;
    errors(r, TRUTH, &POSE, e);
    for (int k = 0; k < 9; k++) most = fmax(most, fabs(e[k]));
    return most;
}

static void test_clean(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0, 1);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_opts o = near_start();
    sdm_fit_result r = fit(&t, &o);
    assert_true(r.converged && r.n_params == 3 && r.n_exact > 3 && r.n_network == 0);
    if (!(worst(&r) < 4e-3)) fail_msg("off by %g", worst(&r));
    // the point spread holds the box of the voxel, the means are those of the phantom
    assert_true(fabs(r.blur - sqrt(0.04 + 0.0625 / 12)) < 0.01);
    assert_true(fabs(r.appearance.inside[0].mean - 40) < 5 && fabs(r.appearance.outside[0].mean - 1300) < 5);
    assert_true(r.evidence > 0 && r.log_likelihood > r.log_likelihood_without && r.inside_share == 1);
    assert_true(r.n_iterations > 1 && r.objective[r.n_iterations - 1] < 0);
    sdm_fit_dispose(&r);

    // another start ends at the same place
    sdm_fit_opts other = o;
    other.start_pose = POSE;
    other.start_params = TRUTH;
    sdm_fit_result a = fit(&t, &o), b = fit(&t, &other);
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(a.params[k] - b.params[k]) < 3e-5);
        assert_true(fabs(a.pose.rotation[k] - b.pose.rotation[k]) < 3e-5);
        assert_true(fabs(a.pose.translation[k] - b.pose.translation[k]) < 3e-5);
    }
    sdm_fit_dispose(&a);
    sdm_fit_dispose(&b);
    free(v);
}

// n fits to noisy phantoms: of one shape with other noise, or of other shapes in other poses
static void spread(size_t n, bool random, double *rms, size_t *beyond)
{
    double square = 0;
    size_t count = 0;
    *beyond = 0;
    for (size_t i = 0; i < n; i++) {
        double p[3], start[3], e[9];
        sdm_pose pose = POSE;
        sdm_fit_opts o = near_start();
        for (size_t k = 0; k < 3; k++) {
            p[k] = TRUTH[k] + (random ? 0.6 * sdm_rng_uniform(5, i, k) - 0.3 : 0);
            start[k] = fmax(p[k] + 0.3 * sdm_rng_uniform(6, i, k) - 0.15, 1.02);
        }
        if (random) pose = sdm_phantom_random_pose(0.5, 0.3, 1000 + i);
        float *v = phantom(p, &pose, 1, 10 + i);
        const sdm_fit_target t = image_of(v);
        o.start_params = start;
        o.start_pose = sdm_pose_compose(&(sdm_pose){{0.05, 0.05, -0.05}, {0.1, 0.1, -0.1}}, &pose);
        sdm_fit_result r = fit(&t, &o);
        errors(&r, p, &pose, e);
        for (size_t k = 0; k < 9; k++) {
            const double z = e[k] / r.sd[k];
            square += z * z;
            count++;
            if (k < 3 && fabs(z) > 3) (*beyond)++;
        }
        sdm_fit_dispose(&r);
        free(v);
    }
    *rms = sqrt(square / (double)count);
}

static size_t n_random = 0;

static void test_honest(void **state)
{
    (void)state;
    double rms;
    size_t beyond;
    spread(n_random ? n_random : 20, n_random > 0, &rms, &beyond);
    printf("errors over standard deviations: root mean square %.2f; %zu parameters beyond 3\n", rms, beyond);
    assert_true(rms > 0.6 && rms < 1.5);
    assert_true((double)beyond <= 0.05 * (double)(n_random ? n_random : 20));
}

static void test_threads(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 3);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.n_threads = 1;
    sdm_fit_result one = fit(&t, &o);
    for (int n = 2; n <= 3; n++) {
        o.n_threads = n;
        sdm_fit_result r = fit(&t, &o);
        assert_memory_equal(r.params, one.params, 3 * sizeof *r.params);
        assert_memory_equal(&r.pose, &one.pose, sizeof r.pose);
        assert_memory_equal(r.covariance, one.covariance, 81 * sizeof *r.covariance);
        assert_int_equal(r.n_iterations, one.n_iterations);
        sdm_fit_dispose(&r);
    }
    sdm_fit_dispose(&one);
    free(v);
}

static void test_labels_of_image(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0.3, 3);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.image_model = SDM_FIT_LABELS;
    sdm_fit_result r = fit(&t, &o);
    // the edge is where the laws cross, not quite where the surface is
    if (!(worst(&r) < 0.25)) fail_msg("off by %g", worst(&r));
    assert_true(r.blur == 0 && r.evidence > 0);
    sdm_fit_dispose(&r);
    free(v);
}

static void test_label_map(void **state)
{
    (void)state;
    const sdm_fit_source source = exact_source();
    const sdm_grid g = image_grid();
    float *v = calloc(sdm_grid_count(&g), sizeof *v);
    if (!v) abort();
    assert_int_equal(sdm_fit_map(&source, TRUTH, &POSE, &g, 1, v, NULL), SDM_OK);
    // against the closed form; the mesh lies inside
    for (size_t i = 0; i < sdm_grid_count(&g); i += 37) {
        const double index[3] = {(double)(i % 36), (double)(i / 36 % 30), (double)(i / 36 / 30)};
        double x[3], y[3], d;
        sdm_grid_world(&g, index, x);
        sdm_pose_apply_inverse(&POSE, x, y);
        assert_int_equal(sdm_instance_distance(ellipsoid, TRUTH, y, &d, NULL), SDM_OK);
        if (fabs(d) < 0.8) assert_true(fabs((double)v[i] - d) < 0.02);
    }
    for (size_t i = 0; i < sdm_grid_count(&g); i++) v[i] = v[i] < 0;
    sdm_fit_target t = image_of(v);
    t.kind = SDM_FIT_LABEL;
    const sdm_fit_opts o = near_start();
    sdm_fit_result r = fit(&t, &o);
    if (!(worst(&r) < 0.02)) fail_msg("off by %g", worst(&r));
    assert_true(isnan(r.evidence));
    sdm_fit_dispose(&r);
    // the logistic prior draws what is curved inwards
    sdm_fit_opts logistic = o;
    logistic.image_model = SDM_FIT_LABELS;
    logistic.l_ref = 0.05;
    r = fit(&t, &logistic);
    if (!(worst(&r) < 0.04)) fail_msg("off by %g", worst(&r));
    assert_true(isnan(r.evidence) && r.blur == 0);
    sdm_fit_dispose(&r);
    v[0] = 2;
    sdm_error err;
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_FORMAT);
    assert_non_null(strstr(err.text, "labels from 0 to 2"));
    free(v);
}

static void test_points(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    assert_int_equal(sdm_instance_mesh(ellipsoid, TRUTH, &m, NULL), SDM_OK);
    double *x = calloc(3 * m.n_vert, sizeof *x);
    if (!x) abort();
    for (size_t i = 0; i < m.n_vert; i++) {
        sdm_pose_apply(&POSE, m.vert + 3 * i, x + 3 * i);
        const double far = i % 20 == 0 ? 0.8 : 0.01; // some lie off
        for (size_t k = 0; k < 3; k++) x[3 * i + k] += far * sdm_rng_normal(1, i, k);
    }
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = x, .n_points = m.n_vert};
    sdm_fit_opts o = near_start();
    o.point_dof = 2;
    sdm_fit_result r = fit(&t, &o);
    if (!(worst(&r) < 0.01)) fail_msg("off by %g", worst(&r));
    assert_true(r.point_sd > 0.003 && r.point_sd < 0.03 && r.n_used == m.n_vert && r.inside_share == 1);
    double e[9];
    errors(&r, TRUTH, &POSE, e);
    for (int k = 0; k < 9; k++) assert_true(fabs(e[k]) < 5 * r.sd[k]);
    sdm_fit_dispose(&r);
    free(x);
    sdm_mesh_dispose(&m);
}

static void test_turns(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 4);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    // a quarter turn off about the shape's z, which no local step finds
    o.start_pose = sdm_pose_compose(&POSE, &(sdm_pose){{0, 0, 1.5707963267948966}, {0, 0, 0}});
    o.start_params = TRUTH;
    o.turns = SDM_FIT_TURNS_AXIS;
    o.n_turns = 8;
    sdm_fit_result r = fit(&t, &o);
    assert_true(r.turn == 2 || r.turn == 6); // half a turn is the same ellipsoid
    for (int k = 0; k < 3; k++) assert_true(fabs(r.params[k] - TRUTH[k]) < 5 * r.sd[k]);
    sdm_fit_dispose(&r);
    o.turns = SDM_FIT_TURNS_SPHERE;
    o.n_turns = 40;
    o.start_pose = sdm_pose_compose(&POSE, &(sdm_pose){{1.1, 0.7, -0.8}, {0, 0, 0}});
    r = fit(&t, &o);
    for (int k = 0; k < 3; k++) assert_true(fabs(r.params[k] - TRUTH[k]) < 5 * r.sd[k]);
    sdm_fit_dispose(&r);
    free(v);
}

static void test_kept(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0, 4);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.keep_params = true;
    o.start_params = TRUTH;
    sdm_fit_result r = fit(&t, &o);
    assert_memory_equal(r.params, TRUTH, sizeof TRUTH);
    assert_true(worst(&r) < 4e-3 && r.sd[0] == 0 && r.sd[3] > 0 && r.correlation[1] == 0);
    sdm_fit_dispose(&r);
    o.keep_params = false;
    o.keep_pose = true;
    o.start_params = START;
    o.start_pose = POSE;
    r = fit(&t, &o);
    assert_true(worst(&r) < 4e-3 && r.sd[0] > 0 && r.sd[3] == 0);
    sdm_fit_dispose(&r);
    free(v);
}

// a strong prior wins over the image, and sd are no larger than it
static void test_priors(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.prior_translation_sd = 1e-5;
    o.prior_rotation_sd = 1e-5;
    sdm_fit_result r = fit(&t, &o);
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(r.pose.translation[k] - o.start_pose.translation[k]) < 1e-3);
        assert_true(fabs(r.pose.rotation[k] - o.start_pose.rotation[k]) < 1e-3);
        assert_true(r.sd[3 + k] < 2e-5 && r.sd[6 + k] < 2e-5);
    }
    sdm_fit_dispose(&r);
    // of half of 1 .. 4: draws the parameters towards 2.5, and they are better known
    o.prior_translation_sd = o.prior_rotation_sd = 0;
    const sdm_fit_result free_of_it = fit(&t, &o);
    o.prior_sd = 0.05;
    r = fit(&t, &o);
    assert_true(r.params[2] > free_of_it.params[2] + 0.2 * free_of_it.sd[2]);
    assert_true(r.params[1] > free_of_it.params[1] + 0.2 * free_of_it.sd[1]);
    for (int k = 0; k < 3; k++) assert_true(r.sd[k] < 0.075 && r.sd[k] < 1.1 * free_of_it.sd[k]);
    sdm_fit_result other = free_of_it;
    sdm_fit_dispose(&other);
    sdm_fit_dispose(&r);
    free(v);
}

static void refused(sdm_status wanted, const char *text, const sdm_fit_target *t, const sdm_fit_opts *o)
{
    const sdm_fit_source source = exact_source();
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status s = sdm_fit(&source, t, o, &r, &err);
    if (s != wanted || !strstr(err.text, text)) fail_msg("%s: %s; wanted: %s", sdm_status_name(s), err.text, text);
    assert_true(s == SDM_E_QUALITY || !r.params);
    sdm_fit_dispose(&r);
}

static void test_no_shape(void **state)
{
    (void)state;
    const sdm_grid g = image_grid();
    const size_t n = sdm_grid_count(&g);
    float *v = calloc(n, sizeof *v);
    if (!v) abort();
    sdm_fit_target t = image_of(v);
    const sdm_fit_opts o = near_start();
    refused(SDM_E_QUALITY, "every voxel is 0", &t, &o);
    for (size_t i = 0; i < n; i++) v[i] = NAN;
    refused(SDM_E_FORMAT, "are NaN", &t, &o);
    for (size_t i = 0; i < n; i++) v[i] = (float)(700 + 300 * sdm_rng_normal(1, 2, i));
    refused(SDM_E_QUALITY, "no such shape", &t, &o);
    free(v);
    v = phantom(TRUTH, &POSE, 1, 5);
    for (size_t i = 0; i < n; i++) v[i] = 1340 - v[i]; // inside and outside change places
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

static bool stop(void *user) { return --*(int *)user < 0; }

static void test_refused(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 5);
    const sdm_fit_target t = image_of(v);
    sdm_fit_opts o = near_start();
    o.start_pose.translation[0] = 100;
    refused(SDM_E_ARG, "no voxel of the image", &t, &o);
    o = near_start();
    o.start_params = (const double[3]){2, 2, 9};
    refused(SDM_E_RANGE, "start of rz = 9", &t, &o);
    o = near_start();
    o.max_iterations = 1;
    refused(SDM_E_QUALITY, "not converged after 1 iterations", &t, &o);
    o = near_start();
    o.l_ref = NAN;
    refused(SDM_E_ARG, "l_ref", &t, &o);
    o = near_start();
    o.appearance.inside[0].sd = 0;
    refused(SDM_E_ARG, "sd of law 0 inside", &t, &o);
    o = near_start();
    o.keep_params = o.keep_pose = true;
    refused(SDM_E_ARG, "nothing to fit", &t, &o);
    for (int calls = 0; calls < 60; calls += 13) {
        int left = calls;
        o = near_start();
        o.cancelled = stop;
        o.user = &left;
        refused(SDM_E_CANCELLED, "", &t, &o);
    }
    v[36 * 30 * 13 + 36 * 15 + 18] = INFINITY;
    o = near_start();
    refused(SDM_E_FORMAT, "infinite", &t, &o);
    v[36 * 30 * 13 + 36 * 15 + 18] = NAN;
    sdm_fit_result r = fit(&t, &o);
    assert_int_equal(r.n_nan, 1);
    sdm_fit_dispose(&r);
    // half of the image is missing: more than half of the shape, and then less
    for (size_t i = 0; i < 36 * 30 * 26; i++)
        if (i % 36 < 20) v[i] = NAN;
    o.least_inside = 0.7;
    refused(SDM_E_QUALITY, "of the shape lies in the image", &t, &o);
    free(v);

    sdm_fit_result none;
    assert_int_equal(sdm_fit(&(sdm_fit_source){0}, &t, &o, &none, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit(NULL, &t, &o, &none, NULL), SDM_E_ARG);
    const sdm_fit_source source = exact_source();
    assert_int_equal(sdm_fit(&source, NULL, &o, &none, NULL), SDM_E_ARG);
    assert_int_equal(sdm_fit(&source, &t, &o, NULL, NULL), SDM_E_ARG);
}

// every now and then memory ends: an error, nothing left behind
static void test_memory(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0, 5);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_source source = exact_source();
    const sdm_fit_opts o = near_start();
    size_t failed = 0;
    for (unsigned long n = 1; n < 1000; n += n < 30 ? 1 : n / 3) {
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

static void test_starts(void **state)
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
        for (int k = 0; k < 3 && n > 2; k++) assert_true(fabs(pose.rotation[k] - POSE.rotation[k]) < 1e-12);
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
        const double length = sqrt(axes[i][0] * axes[i][0] + axes[i][1] * axes[i][1] + axes[i][2] * axes[i][2]);
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(a[k] - centre[k]) < 1e-12);
            assert_true(fabs(b[k] - a[k] - axes[i][k] / length) < 1e-12);
        }
    }
    assert_int_equal(sdm_fit_pose_from_axis(point, centre, (double[3]){0, 0, 0}, &pose, NULL), SDM_E_ARG);

    const sdm_fit_source source = exact_source();
    double middle[3];
    assert_int_equal(sdm_fit_centre(&source, TRUTH, middle, NULL), SDM_OK);
    for (int k = 0; k < 3; k++) assert_true(fabs(middle[k]) < 0.05);
}

int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_clean),     cmocka_unit_test(test_honest),  cmocka_unit_test(test_threads),
        cmocka_unit_test(test_label_map), cmocka_unit_test(test_points),  cmocka_unit_test(test_labels_of_image),
        cmocka_unit_test(test_turns),     cmocka_unit_test(test_kept),    cmocka_unit_test(test_priors),
        cmocka_unit_test(test_no_shape),  cmocka_unit_test(test_refused), cmocka_unit_test(test_starts),
        cmocka_unit_test(test_memory),
    };
    const struct CMUnitTest longer[] = {cmocka_unit_test(test_honest)};
    n_random = argc > 1 ? (size_t)strtoul(argv[1], NULL, 10) : 0;
    return n_random ? cmocka_run_group_tests(longer, set_up, tear_down)
                    : cmocka_run_group_tests(tests, set_up, tear_down);
}
