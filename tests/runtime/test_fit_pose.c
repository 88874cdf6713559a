/* The pose of a fit: motions that the data leave open, a pose or parameter that is kept but wrong,
 * and one that still moves. Tests: convergence.c kept_gain.c kept_params.c kept_pose.c
 * open_motions.c pose_params.c source_params.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#include <cmocka.h>

#include "fit/solver/open_motions.h"
#include "fit/trust/convergence.h"
#include "oracle/fit_tools.h"

// Eigenvectors of a matrix that is made from known ones.
static void test_eigenvectors(void **state)
{
    (void)state;
    const double values[3] = {-2, 0.5, 7};
    double r[9], a[9] = {0}, value[3], vector[9];
    sdm_pose_matrix(&(sdm_pose){{0.4, -0.7, 1.1}, {0, 0, 0}}, r);
    for (size_t i = 0; i < 9; i++)
        for (size_t k = 0; k < 3; k++) a[i] += values[k] * r[3 * k + i / 3] * r[3 * k + i % 3];
    sdm_fit_eigen(3, a, value, vector);
    for (size_t k = 0; k < 3; k++) {
        assert_true(fabs(value[k] - values[k]) < 1e-12);
        double dot = 0;
        for (size_t i = 0; i < 3; i++) dot += vector[3 * k + i] * r[3 * k + i];
        assert_true(fabs(fabs(dot) - 1) < 1e-12);
    }
}

// A fit of `name` with these options to 3000 points on its own surface in POSE; the start has its
// axis 0.1 rad off.
static sdm_fit_result fit_with(const char *name, const sdm_named_text *options, size_t n_options,
                               const double *p)
{
    enum { N = 3000 };
    sdm_instance *shape = NULL;
    sdm_mesh m = {0};
    double x[3 * N];
    assert_int_equal(sdm_instance_create(sdm_registry_find(registry, name, NULL), options,
                                         n_options, NULL, &shape, NULL),
                     SDM_OK);
    assert_int_equal(sdm_instance_mesh(shape, p, &m, NULL), SDM_OK);
    assert_int_equal(sdm_fit_surface_points(&m, N, 2, x, NULL), SDM_OK);
    for (size_t i = 0; i < N; i++) {
        double y[3];
        for (size_t k = 0; k < 3; k++) // independent errors of 0.02 mm
            y[k] = x[3 * i + k] + 0.02 * sdm_rng_normal(1, k, i);
        sdm_pose_apply(&POSE, y, x + 3 * i);
    }
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){40, 40, 40}, 0.25, (double[3]){0, 0, 0})};
    const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = N};
    sdm_fit_opts o = sdm_fit_defaults();
    o.start_pose = POSE;
    o.start_pose.rotation[1] += 0.1;
    o.n_threads = 2;
    sdm_fit_result r;
    sdm_error err = {0};
    if (sdm_fit(&source, &target, &o, &r, &err)) fail_msg("%s: %s", name, err.text);
    sdm_mesh_dispose(&m);
    sdm_instance_free(shape);
    return r;
}

static sdm_fit_result fit_surface(const char *name, const double *p)
{
    return fit_with(name, &(sdm_named_text){"edge", "0.1"}, 1, p);
}

// sd of the rotation about the unit vector `axis` of the world.
static double turn_sd(const sdm_fit_result *r, const double axis[3])
{
    const size_t n = r->n_params, size = n + 6;
    double sum = 0;
    for (size_t i = 0; i < 3; i++)
        for (size_t k = 0; k < 3; k++)
            sum += axis[i] * axis[k] * r->covariance[(n + i) * size + n + k];
    return sqrt(sum);
}

static void test_axis_of_symmetry(void **state)
{
    (void)state;
    const struct {
        const char *name;
        double p[3];
    } cases[] = {{"torus", {2.6, 0.9, 0}}, {"capsule", {1.2, 3.1, 0}}, {"ellipsoid", {2, 2, 3}}};
    double r[9];
    sdm_pose_matrix(&POSE, r);
    const double along[3] = {r[2], r[5], r[8]}, across[3] = {r[0], r[3], r[6]};
    for (size_t c = 0; c < 3; c++) {
        sdm_fit_result f = fit_surface(cases[c].name, cases[c].p);
        double axis[3], x[3];
        if (sscanf(f.open_motions,
                   "rotation about the axis (%lf, %lf, %lf) through (%lf, %lf, %lf) mm", &axis[0],
                   &axis[1], &axis[2], &x[0], &x[1], &x[2]) != 6)
            fail_msg("%s: '%s'", cases[c].name, f.open_motions);
        double dot = 0;
        for (size_t k = 0; k < 3; k++) {
            dot += axis[k] * along[k];
            assert_true(fabs(x[k] - POSE.translation[k]) < 0.02);
        }
        assert_true(fabs(fabs(dot) - 1) < 0.01);
        // an angle that may be any has the sd pi / sqrt(3)
        assert_true(fabs(turn_sd(&f, along) - 1.81) < 0.1 && turn_sd(&f, across) < 0.05);
        for (int k = 0; k < 6; k++)
            assert_true(f.pose_sd_determined[k] >= 0 && f.pose_sd_determined[k] < 0.05 &&
                        f.pose_sd_determined[k] <= f.sd[f.n_params + (size_t)k]);
        sdm_fit_dispose(&f);
    }
}

static void test_sphere_has_any_axis(void **state)
{
    (void)state;
    sdm_fit_result f = fit_surface("ellipsoid", (const double[3]){2, 2, 2});
    assert_non_null(strstr(f.open_motions, "rotation about any axis"));
    sdm_fit_dispose(&f);
}

static void test_determined_pose(void **state)
{
    (void)state;
    sdm_fit_result f = fit_surface("ellipsoid", (const double[3]){2, 2.3, 3});
    assert_string_equal(f.open_motions, "");
    for (size_t k = 3; k < 6; k++) assert_true(f.sd[k] < 0.05);
    sdm_fit_dispose(&f);
}

// The first joint of an arm on a round base turns it as the pose does: only the sum of both angles
// is determined. The second joint is not concerned.
static void test_joint_that_is_a_pose(void **state)
{
    (void)state;
    const sdm_named_text options[] = {
        {"links", "2"}, {"length", "1.5"}, {"base", "1.5"}, {"edge", "0.2"}};
    double r[9];
    sdm_pose_matrix(&POSE, r);
    const double along[3] = {r[2], r[5], r[8]}, across[3] = {r[0], r[3], r[6]};
    sdm_fit_result f = fit_with("linkage", options, 4, (const double[2]){0.2, 0.5});
    assert_string_equal(f.open_motions, "");
    assert_true(f.by_prior[0] && f.sd[0] > 1.1 && f.sd[0] < 1.4);
    assert_true(!f.by_prior[1] && f.sd[1] < 0.1 && fabs(f.params[1] - 0.5) < 0.1);
    assert_true(fabs(turn_sd(&f, along) - f.sd[0]) < 0.1 && turn_sd(&f, across) < 0.1);
    // a change of the joint, and the turn of the pose that undoes it
    double turn = 0;
    for (size_t k = 0; k < 3; k++) turn += along[k] * f.correlation[2 + k];
    assert_true(turn < -0.9);
    sdm_fit_dispose(&f);
}

// The links are 3 mm long, the first one along x, with the second joint at (3, 0, 0). The first
// link meets the ball of this joint at x = 2.54, and for other angles at up to x = 3.1. Whether the
// point says nothing about the joint.
static bool is_past_joint(const double x[3]) { return x[0] > 3.2; }

// Motion (mm per rad) of the surface of the first link along its normal as it turns about the
// second joint; the ball of the first joint has a radius of 1.08 mm.
static double motion_about_joint(const double x[3])
{
    const double length = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]),
                 across = sqrt(x[1] * x[1] + x[2] * x[2]);
    return length < 1.1 ? -3 * x[1] / length : (x[0] - 3) * x[1] / across;
}

static const double POINT_ERROR = 0.02;

// x[n][3], points on the shape: keeps every `every`-th point of the first link (0: none) and all
// past the second joint, adds errors and brings them into POSE; returns their number. *information:
// the information of the kept points of the first link on its angle about the joint.
static size_t thin_link(double *x, size_t n, size_t every, double *information)
{
    size_t kept = 0, before = 0;
    *information = 0;
    for (size_t i = 0; i < n; i++) {
        const double *from = x + 3 * i;
        if (!is_past_joint(from)) {
            if (!every || from[0] > 2.5 || before++ % every) continue;
            *information += pow(motion_about_joint(from) / POINT_ERROR, 2);
        }
        double y[3];
        for (size_t k = 0; k < 3; k++) y[k] = from[k] + POINT_ERROR * sdm_rng_normal(1, k, i);
        sdm_pose_apply(&POSE, y, x + 3 * kept++);
    }
    return kept;
}

// Nearly all points lie on the last link, which the second joint turns as the pose does. 27 points
// on the first link determine the joint none the less. They alone tell the angle between the links,
// because the pose of the last link is well known. Without these points nothing determines the
// joint.
static void test_joint_seen_by_few_points(void **state)
{
    (void)state;
    enum { N = 8000 };
    static double x[3 * N];
    const double p[2] = {0, 0.4};
    const sdm_named_text options[] = {
        {"links", "2"}, {"base", "0"}, {"edge", "0.2"}, {"limit", "0.5"}};
    sdm_instance *shape = NULL;
    sdm_mesh m = {0};
    assert_int_equal(sdm_instance_create(sdm_registry_find(registry, "linkage", NULL), options, 4,
                                         NULL, &shape, NULL),
                     SDM_OK);
    assert_int_equal(sdm_instance_mesh(shape, p, &m, NULL), SDM_OK);
    const sdm_fit_source source = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){20, 20, 20}, 0.6, (double[3]){2, 0, 0})};
    sdm_fit_opts o = sdm_fit_defaults();
    o.start_pose = POSE;
    o.start_params = p;
    o.kept = (const bool[2]){true, false};
    o.n_threads = 2;
    for (int seen = 0; seen < 2; seen++) {
        double information;
        assert_int_equal(sdm_fit_surface_points(&m, N, 2, x, NULL), SDM_OK);
        const size_t n = thin_link(x, N, seen ? 160 : 0, &information);
        const sdm_fit_target target = {.kind = SDM_FIT_POINTS, .points = x, .n_points = n};
        sdm_fit_result r;
        sdm_error err = {0};
        const sdm_status s = sdm_fit(&source, &target, &o, &r, &err);
        // a fit that determines no parameter is refused
        if (s && (seen || s != SDM_E_QUALITY)) fail_msg("%s", err.text);
        const double expected = seen ? 1 / sqrt(information) : 0.5;
        if (!(r.sd[1] > 0.8 * expected && r.sd[1] < 1.25 * expected))
            fail_msg("seen %d: sd %g, expected %g", seen, r.sd[1], expected);
        assert_int_equal(r.by_prior[1], !seen);
        assert_true(!seen || fabs(r.params[1] - p[1]) < 3 * expected);
        sdm_fit_dispose(&r);
    }
    sdm_mesh_dispose(&m);
    sdm_instance_free(shape);
}

// The evidence with the shape's parameters as unknowns, if `share` times the noise factor of the
// covariance voxels count as one independent one.
static double evidence_at(const sdm_fit_result *r, double share)
{
    const double factor = fmax(share * r->noise_factor, 1);
    return (r->log_likelihood - r->log_likelihood_without) / factor -
           0.5 * (double)r->n_params * log((double)r->n_used / factor);
}

// A kept pose passes where it is true, and is refused half a millimetre beside the truth.
static void test_kept_pose(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 4);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_source source = exact_source();
    for (int off = 0; off < 2; off++) {
        sdm_fit_opts o = near_start();
        o.start_pose = POSE;
        o.start_pose.translation[1] += 0.5 * off;
        o.keep_pose = true;
        sdm_fit_result r;
        sdm_error err = {0};
        const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
        assert_int_equal(s, off ? SDM_E_QUALITY : SDM_OK);
        assert_true(!off || strstr(err.text, "the kept pose does not match"));
        for (int k = 0; k < 3; k++)
            assert_true(r.pose.translation[k] == o.start_pose.translation[k]);
        // a translation by d moves a sphere's surface by d / sqrt(3) along its normal, rms
        if (off) assert_true(r.kept_pose_motion > 0.2 && r.kept_pose_motion < 0.5);
        assert_true(off ? r.kept_pose_gain > 20 : r.kept_pose_gain < 10);
        // the likelihood is that of the kept pose, as the evidence (Schwarz 1978) is
        assert_true(r.evidence > evidence_at(&r, 2.5));
        if (!off) assert_true(r.evidence < evidence_at(&r, 0.4));
        sdm_fit_dispose(&r);
    }
    free(v);
}

// A parameter that is kept at its true value passes; one that is off by 0.3 mm does not. The check
// names it and the value that the data want.
static void test_kept_param(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 4);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_source source = exact_source();
    for (int off = 0; off < 2; off++) {
        const double start[3] = {TRUTH[0], TRUTH[1] + 0.3 * off, TRUTH[2]};
        sdm_fit_opts o = near_start();
        o.start_params = start;
        o.kept = (const bool[3]){false, true, false};
        sdm_fit_result r;
        sdm_error err = {0};
        const sdm_status s = sdm_fit(&source, &t, &o, &r, &err);
        assert_true(s == SDM_OK || (off && s == SDM_E_QUALITY));
        assert_true(r.params[1] == start[1]);
        const sdm_fit_finding *kept = NULL;
        for (size_t i = 0; i < r.verdict.n_findings; i++)
            if (r.verdict.findings[i].kind == SDM_FIT_CHECK_KEPT_PARAMS)
                kept = &r.verdict.findings[i];
        assert_non_null(kept);
        assert_int_equal(r.verdict.grade > SDM_FIT_PASSED, off);
        assert_non_null(strstr(kept->text, off ? "at which ry is kept: free, it goes to 1.8"
                                               : "with 'ry' free the fit goes to ry = 1.8"));
        assert_int_equal(kept->figure > kept->limit, off);
        sdm_fit_dispose(&r);
    }
    free(v);
}

// The steps of the test of the pose say nothing about the convergence of the fit.
static void test_kept_pose_not_converged(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 1, 4);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_source source = exact_source();
    sdm_fit_opts o = near_start();
    o.start_pose = POSE;
    o.keep_pose = true;
    o.max_iterations = 1;
    sdm_fit_result r;
    sdm_error err = {0};
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_QUALITY);
    assert_false(r.converged);
    assert_non_null(strstr(err.text, "not converged"));
    assert_true(r.kept_pose_gain < 10);
    sdm_fit_dispose(&r);
    free(v);
}

// The translation along x still moves by five times its sd; a fit with an unknown that has no sd
// never passes.
static void test_restless_unknown(void **state)
{
    (void)state;
    enum { N = 6, MOVES = 3 };
    static fit_problem p;
    const sdm_fit_opts o = sdm_fit_defaults();
    double sd[N] = {1, 1, 1, 1, 1, 1};
    sdm_fit_result r = {.sd = sd, .n_iterations = 60};
    sdm_error err = {0};
    p.opts = &o;
    p.recent.n = FIT_RECENT;
    for (size_t k = 0; k < FIT_RECENT; k++)
        for (size_t i = 0; i < N; i++) p.recent.step[k][i] = i == MOVES ? 5 : 0.01;
    sdm_fit_accept_small_steps(&p, &r);
    assert_false(r.converged);
    sdm_fit_verdict_add(&r.verdict, &(sdm_fit_finding){.kind = SDM_FIT_CHECK_CONVERGED,
                                                       .grade = SDM_FIT_FAILED,
                                                       .text = "not converged"});
    sdm_fail(&err, SDM_E_QUALITY, "%s", r.verdict.findings[0].text);
    sdm_fit_name_restless(&p, &r, &err);
    assert_non_null(strstr(err.text, "translation along x still moves by 5 of its"));
    assert_non_null(strstr(r.verdict.findings[0].text, "translation along x"));
    // after few iterations, and where a standard deviation is unknown
    p.recent.n = 2;
    sdm_fit_name_restless(&p, &r, NULL);
    assert_non_null(strstr(r.verdict.findings[0].text, "translation along x still moves by 5 of"));
    p.recent.n = FIT_RECENT;
    sd[MOVES] = 1e3;
    sd[MOVES + 1] = NAN;
    sdm_fit_name_restless(&p, &r, NULL);
    assert_non_null(strstr(r.verdict.findings[0].text, "translation along y may still move"));
    sdm_fit_accept_small_steps(&p, &r);
    assert_false(r.converged);
    sd[MOVES] = 1, sd[N - 1] = 1e3;
    sdm_fit_accept_small_steps(&p, &r);
    assert_false(r.converged);
    sd[MOVES] = 1e3, sd[MOVES + 1] = 1;
    sdm_fit_accept_small_steps(&p, &r);
    assert_true(r.converged);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_eigenvectors),
        cmocka_unit_test(test_axis_of_symmetry),
        cmocka_unit_test(test_sphere_has_any_axis),
        cmocka_unit_test(test_determined_pose),
        cmocka_unit_test(test_kept_param),
        cmocka_unit_test(test_kept_pose),
        cmocka_unit_test(test_kept_pose_not_converged),
        cmocka_unit_test(test_restless_unknown),
        cmocka_unit_test(test_joint_that_is_a_pose),
        cmocka_unit_test(test_joint_seen_by_few_points),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
