/* Fits to meshes and points: points spread over the surface of a union, outliers, and standard
 * deviations that do not shrink with the number of points on one surface; sharp edges.
 * Tests: point_covariance.c surface_points.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/fit_tools.h"
#include "oracle/give_mesh.h"

// ---- points on a surface

// Appends the box from low to high, its triangles counter-clockwise seen from outside.
static void add_box(sdm_mesh *m, const double low[3], const double high[3])
{
    static const uint32_t corner[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6},
                                           {0, 1, 4}, {1, 5, 4}, {2, 6, 3}, {3, 6, 7},
                                           {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
    const size_t v = m->n_vert, t = m->n_tri;
    assert_int_equal(sdm_mesh_reserve(m, v + 8, t + 12, NULL), SDM_OK);
    for (size_t i = 0; i < 8; i++)
        for (size_t a = 0; a < 3; a++) m->vert[3 * (v + i) + a] = i >> a & 1 ? high[a] : low[a];
    for (size_t i = 0; i < 12; i++)
        for (size_t k = 0; k < 3; k++) m->tri[3 * (t + i) + k] = (uint32_t)v + corner[i][k];
}

enum { MANY = 5600 };

static void test_flat_faces_have_their_share(void **state)
{
    (void)state;
    const double low[3] = {0, 0, 0}, high[3] = {5, 3, 2}, area = 2 * (15 + 10 + 6);
    sdm_mesh m = {0};
    double x[3 * MANY], mean[3] = {0, 0, 0};
    add_box(&m, low, high);
    assert_int_equal(sdm_fit_surface_points(&m, MANY, 1, x, NULL), SDM_OK);
    size_t on[3][2] = {{0}};
    for (size_t i = 0; i < MANY; i++)
        for (size_t a = 0; a < 3; a++) {
            on[a][0] += fabs(x[3 * i + a] - low[a]) < 1e-12;
            on[a][1] += fabs(x[3 * i + a] - high[a]) < 1e-12;
            mean[a] += x[3 * i + a] / MANY;
        }
    for (size_t a = 0; a < 3; a++) {
        const double face = high[(a + 1) % 3] * high[(a + 2) % 3];
        for (int side = 0; side < 2; side++)
            assert_true(fabs((double)on[a][side] - MANY * face / area) <= 2); // two triangles
        assert_true(fabs(mean[a] - 0.5 * high[a]) < 0.01);
    }
    sdm_mesh_dispose(&m);
}

static void test_no_point_is_buried(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    double x[3 * MANY];
    add_box(&m, (const double[3]){0, 0, 0}, (const double[3]){2, 2, 2});
    add_box(&m, (const double[3]){1, 0.5, 0.5}, (const double[3]){3, 1.5, 1.5});
    assert_int_equal(sdm_fit_surface_points(&m, MANY, 2, x, NULL), SDM_OK);
    size_t beyond = 0;
    for (size_t i = 0; i < MANY; i++) {
        const double *p = x + 3 * i, e = 1e-9;
        const bool first = p[0] > e && p[0] < 2 - e && p[1] > e && p[1] < 2 - e && p[2] > e &&
                           p[2]<2 - e, second = p[0]> 1 + e && p[0] < 3 - e && p[1] > 0.5 + e &&
                           p[1] < 1.5 - e && p[2] > 0.5 + e && p[2] < 1.5 - e;
        assert_false(first || second);
        beyond += p[0] > 2 + e;
    }
    // the union has 24 + 10 - 6 = 28 mm^2, of which 5 lie beyond the first box
    assert_true(fabs((double)beyond - MANY * 5.0 / 28) <= 12);
    sdm_mesh_dispose(&m);
}

static void test_mesh_without_area(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    double x[30];
    sdm_error err = {0};
    assert_int_equal(sdm_fit_surface_points(&m, 10, 1, x, &err), SDM_E_MESH);
    assert_true(*err.text);
}

// ---- fits

// Points on the surface of a shape at p in POSE, moved outwards by `bump` times a wave over the
// surface (n points; the caller frees).
static double *points_of(const sdm_instance *shape, const double *p, double bump, size_t n)
{
    sdm_mesh m = {0};
    double *x = calloc(3 * n, sizeof *x);
    if (!x) abort();
    assert_int_equal(sdm_instance_mesh(shape, p, &m, NULL), SDM_OK);
    assert_int_equal(sdm_fit_surface_points(&m, n, 2, x, NULL), SDM_OK);
    sdm_mesh_dispose(&m);
    for (size_t i = 0; i < n; i++) {
        double y[3];
        for (size_t k = 0; k < 3; k++)
            y[k] = x[3 * i + k] * (1 + bump * sin(4 * x[3 * i]) * cos(5 * x[3 * i + 1]));
        sdm_pose_apply(&POSE, y, x + 3 * i);
    }
    return x;
}

// A fit, also one that is refused. kept_sd: the standard deviation of the points as given and kept;
// 0: it is estimated
static sdm_fit_result fit_keeping(const sdm_instance *shape, const double *x, size_t n,
                                  double kept_sd)
{
    const sdm_fit_source s = {
        .shape = shape,
        .grid = sdm_grid_centred((int64_t[3]){40, 40, 40}, 0.25, (double[3]){0, 0, 0})};
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = x, .n_points = n};
    sdm_fit_opts o = sdm_fit_defaults();
    o.start_pose = POSE;
    o.start_pose.translation[0] += 0.4, o.start_pose.rotation[1] += 0.15;
    o.n_threads = 2;
    if (kept_sd > 0) o.point_sd = kept_sd, o.keep_appearance = true;
    sdm_fit_result r;
    sdm_error err = {0};
    const sdm_status status = sdm_fit(&s, &t, &o, &r, &err);
    if (status && status != SDM_E_QUALITY) fail_msg("%s", err.text);
    return r;
}

static sdm_fit_result fit_points(const sdm_instance *shape, const double *x, size_t n)
{
    const sdm_fit_result r = fit_keeping(shape, x, n, 0);
    for (size_t i = 0; i < r.verdict.n_findings; i++)
        if (r.verdict.findings[i].grade == SDM_FIT_FAILED)
            fail_msg("%s", r.verdict.findings[i].text);
    return r;
}

static void test_shapes_are_found(void **state)
{
    (void)state;
    const struct {
        const char *name;
        double p[3];
    } cases[] = {
        {"ellipsoid", {2.5, 1.8, 1.3}}, {"torus", {2.6, 0.9, 0}}, {"capsule", {1.2, 3.1, 0}}};
    enum { N = 6000 };
    for (size_t c = 0; c < 3; c++) {
        sdm_instance *shape = NULL;
        sdm_named_text edge = {"edge", "0.1"};
        assert_int_equal(sdm_instance_create(sdm_registry_find(registry, cases[c].name, NULL),
                                             &edge, 1, NULL, &shape, NULL),
                         SDM_OK);
        double *x = points_of(shape, cases[c].p, 0, N);
        // a quarter of the points lies anywhere in a box around the shape
        for (size_t i = 0; i < N; i += 4)
            for (size_t k = 0; k < 3; k++) x[3 * i + k] = 10 * sdm_rng_uniform(3, k, i) - 5;
        sdm_fit_result r = fit_points(shape, x, N);
        for (size_t k = 0; k < r.n_params; k++)
            if (!(fabs(r.params[k] - cases[c].p[k]) < 0.005))
                fail_msg("%s: parameter %zu is %g", cases[c].name, k, r.params[k]);
        for (size_t k = 0; k < 3; k++)
            assert_true(fabs(r.pose.translation[k] - POSE.translation[k]) < 0.005);
        // some outliers lie near the surface by chance
        assert_true(r.outliers > 0.18 && r.outliers < 0.26 && r.point_sd < 0.02);
        sdm_fit_dispose(&r);
        free(x);
        sdm_instance_free(shape);
    }
}

/* On a surface that the shape does not match, more points tell no more: the standard deviations
 * stay the same. Points with independent errors do: four times as many halve them. */
static void test_deviations_count_independent_points(void **state)
{
    (void)state;
    for (int noisy = 0; noisy < 2; noisy++) {
        sdm_fit_result r[2];
        for (size_t i = 0; i < 2; i++) {
            const size_t n = i ? 12000 : 3000;
            double *x = points_of(ellipsoid, TRUTH, noisy ? 0 : 0.04, n);
            for (size_t k = 0; k < 3 * n && noisy; k++) x[k] += 0.1 * sdm_rng_normal(7, i, k);
            r[i] = fit_points(ellipsoid, x, n);
            free(x);
        }
        for (size_t k = 0; k < 3; k++) {
            const double ratio = r[0].sd[k] / r[1].sd[k], low = noisy ? 1.5 : 0.85,
                         high = noisy ? 2.3 : 1.2;
            if (!(ratio > low && ratio < high))
                fail_msg("noise %d, parameter %zu: sd %g and %g", noisy, k, r[0].sd[k], r[1].sd[k]);
        }
        // errors of the bumpy surface are about as large as the deviations tell
        for (size_t k = 0; k < 3; k++)
            for (int i = 0; i < 2; i++)
                assert_true(fabs(r[i].params[k] - TRUTH[k]) < 4 * r[i].sd[k]);
        sdm_fit_dispose(&r[0]);
        sdm_fit_dispose(&r[1]);
    }
}

// A brick: flat faces and sharp edges, which the voxels of a map would cut off.
static int brick_mesh(const void *self, const sdm_host *host, const sdm_option_value *options,
                      const double *p, sdm_mesh_out *out)
{
    (void)self, (void)options;
    sdm_mesh m = {0};
    add_box(&m, (const double[3]){-0.5 * p[0], -0.5 * p[1], -0.5 * p[2]},
            (const double[3]){0.5 * p[0], 0.5 * p[1], 0.5 * p[2]});
    return give_mesh(host, out, &m);
}

static const sdm_param brick_params[] = {
    {"length", "mm", 3, 6, 5, ""}, {"width", "mm", 2, 5, 4, ""}, {"height", "mm", 0.8, 3, 1, ""}};
static const sdm_shape brick = {.abi = SDM_SHAPE_ABI,
                                .size = sizeof(sdm_shape),
                                .name = "brick",
                                .summary = "brick",
                                .params = brick_params,
                                .n_params = 3,
                                .mesh = brick_mesh};

static void test_sharp_edges_are_met(void **state)
{
    (void)state;
    const double truth[3] = {4.87, 3.71, 1.13};
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&brick, NULL, 0, NULL, &shape, NULL), SDM_OK);
    double *x = points_of(shape, truth, 0, 1500);
    sdm_fit_result r = fit_points(shape, x, 1500);
    for (size_t k = 0; k < 3; k++) {
        const double error = fabs(r.params[k] - truth[k]);
        if (!(error < 1e-4 && r.sd[k] < 1e-3))
            fail_msg("parameter %zu is off by %g, sd %g", k, error, r.sd[k]);
    }
    sdm_fit_dispose(&r);
    free(x);
    sdm_instance_free(shape);
}

/* Where only two or three points lie in a neighbourhood, their scatter about their own mean is
 * corrected for it: the residuals of a right fit are noise, and the standard deviation that is
 * reported is that of the points. */
static void test_few_points_in_a_neighbourhood_raise_no_doubt(void **state)
{
    (void)state;
    enum { N = 900 };
    const double truth[3] = {4.9, 3.8, 0.95}, noise = 0.05;
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&brick, NULL, 0, NULL, &shape, NULL), SDM_OK);
    double *x = points_of(shape, truth, 0, N);
    for (size_t i = 0; i < N; i++)
        for (size_t k = 0; k < 3; k++) x[3 * i + k] += noise * sdm_rng_normal(31, k, i);
    sdm_fit_result r = fit_points(shape, x, N);
    for (size_t i = 0; i < r.verdict.n_findings; i++) {
        const sdm_fit_finding *f = &r.verdict.findings[i];
        if (f->kind == SDM_FIT_CHECK_RESIDUALS && f->grade != SDM_FIT_PASSED)
            fail_msg("residuals %g, limit %g", f->figure, f->limit);
    }
    if (!(fabs(r.point_sd / noise - 1) < 0.08)) fail_msg("standard deviation %g", r.point_sd);
    sdm_fit_dispose(&r);
    free(x);
    sdm_instance_free(shape);
}

/* Where most points are alone in their neighbourhood, right fits are not doubted for it: their
 * residuals are about 1, or there are too few to test the fit, and the text says so. */
static void test_sparse_points_raise_no_doubt(void **state)
{
    (void)state;
    static const size_t n[] = {100, 300, 500, 700};
    const double truth[3] = {4.9, 3.8, 0.95}, noise = 0.05;
    sdm_instance *shape = NULL;
    assert_int_equal(sdm_instance_create(&brick, NULL, 0, NULL, &shape, NULL), SDM_OK);
    for (size_t c = 0; c < sizeof n / sizeof *n; c++) {
        double *x = points_of(shape, truth, 0, n[c]);
        for (size_t i = 0; i < n[c]; i++)
            for (size_t k = 0; k < 3; k++) x[3 * i + k] += noise * sdm_rng_normal(31, k, i);
        sdm_fit_result r = fit_points(shape, x, n[c]);
        for (size_t i = 0; i < r.verdict.n_findings; i++) {
            const sdm_fit_finding *f = &r.verdict.findings[i];
            if (f->kind != SDM_FIT_CHECK_RESIDUALS || strstr(f->text, "nothing tests")) continue;
            if (f->grade != SDM_FIT_PASSED || !(f->figure > 0.3) || n[c] < 200)
                fail_msg("%zu points: residuals %g, limit %g: %s", n[c], f->figure, f->limit,
                         f->text);
        }
        sdm_fit_dispose(&r);
        free(x);
    }
    sdm_instance_free(shape);
}

/* Points of another surface, in a fit that keeps their standard deviation: the fit is doubted where
 * they lie farther off its surface than that. With the right surface it is not. */
static void test_given_deviation_tests_the_fit(void **state)
{
    (void)state;
    enum { N = 3000 };
    const double noise = 0.02;
    for (int bumpy = 0; bumpy < 2; bumpy++) {
        double *x = points_of(ellipsoid, TRUTH, bumpy ? 0.04 : 0, N);
        for (size_t k = 0; k < 3 * N; k++) x[k] += noise * sdm_rng_normal(7, 1, k);
        sdm_fit_result r = fit_keeping(ellipsoid, x, N, noise);
        const sdm_fit_finding *f = NULL;
        for (size_t i = 0; i < r.verdict.n_findings; i++)
            if (r.verdict.findings[i].kind == SDM_FIT_CHECK_RESIDUALS) f = &r.verdict.findings[i];
        if (!f || (f->grade == SDM_FIT_PASSED) == bumpy)
            fail_msg("bumpy %d: %g, limit %g: %s", bumpy, f ? f->figure : 0, f ? f->limit : 0,
                     f ? f->text : "");
        assert_true(!bumpy || strstr(f->text, "are given as their standard deviation"));
        sdm_fit_dispose(&r);
        free(x);
    }
}

/* A smooth bulge on a small part of the surface, in fits that keep the standard deviation of the
 * points: a high one contradicts it, a low one raises doubt, strays that lie alone do no more. */
static void test_a_bulge_contradicts_the_given_deviation(void **state)
{
    (void)state;
    enum { N = 3000 };
    const double noise = 0.02;
    const struct {
        double bulge; /* mm, on the points with z > 0.7 of the half axis */
        size_t stray; /* every so many points lie 0.12 mm off the surface */
        sdm_fit_grade grade;
    } cases[] = {{0.3, 0, SDM_FIT_FAILED}, {0.15, 0, SDM_FIT_DOUBTFUL}, {0, 20, SDM_FIT_DOUBTFUL}};
    for (size_t c = 0; c < sizeof cases / sizeof *cases; c++) {
        double *x = points_of(ellipsoid, TRUTH, 0, N);
        for (size_t i = 0; i < N; i++) {
            double y[3];
            sdm_pose_apply_inverse(&POSE, x + 3 * i, y);
            const double top = fmax(0, y[2] / TRUTH[2] - 0.7) / 0.3,
                         stray = cases[c].stray && i % cases[c].stray == 0 ? 0.12 : 0;
            for (size_t k = 0; k < 3; k++)
                y[k] *= 1 + (cases[c].bulge * top + stray) /
                                sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2]);
            sdm_pose_apply(&POSE, y, x + 3 * i);
            for (size_t k = 0; k < 3; k++) x[3 * i + k] += noise * sdm_rng_normal(7, 1, 3 * i + k);
        }
        sdm_fit_result r = fit_keeping(ellipsoid, x, N, noise);
        const sdm_fit_finding *f = NULL;
        for (size_t i = 0; i < r.verdict.n_findings; i++)
            if (r.verdict.findings[i].kind == SDM_FIT_CHECK_RESIDUALS) f = &r.verdict.findings[i];
        if (!f || f->grade != cases[c].grade)
            fail_msg("case %zu: grade %d, %g, limit %g: %s", c, f ? (int)f->grade : -1,
                     f ? f->figure : 0, f ? f->limit : 0, f ? f->text : "");
        sdm_fit_dispose(&r);
        free(x);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_flat_faces_have_their_share),
        cmocka_unit_test(test_no_point_is_buried),
        cmocka_unit_test(test_mesh_without_area),
        cmocka_unit_test(test_shapes_are_found),
        cmocka_unit_test(test_deviations_count_independent_points),
        cmocka_unit_test(test_sharp_edges_are_met),
        cmocka_unit_test(test_few_points_in_a_neighbourhood_raise_no_doubt),
        cmocka_unit_test(test_sparse_points_raise_no_doubt),
        cmocka_unit_test(test_given_deviation_tests_the_fit),
        cmocka_unit_test(test_a_bulge_contradicts_the_given_deviation),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
