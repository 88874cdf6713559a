/* Errors that neighbouring points share: independent errors are never taken for them, a smooth
 * difference between object and shape always.
 * Tests: shared_errors.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "fit/points/shared_errors.h"
#include "oracle/fit_tools.h"

enum { MOST = 20000 };
#define PI 3.14159265358979324
#define RADIUS 3.0
#define NOISE 0.03

typedef enum tails { NORMAL, LONG_TAILED } tails;

/* Points on a ball, with feet and distances; `wave` mm is the root mean square of a difference
 * whose waves are as long as the radius. */
static fit_shared_errors ball(size_t n, uint64_t seed, double noise, double wave, tails kind)
{
    double(*place)[3] = calloc(n, sizeof *place), (*foot)[3] = calloc(n, sizeof *foot),
    *distance = calloc(n, sizeof *distance);
    if (!place || !foot || !distance) abort();
    for (size_t i = 0; i < n; i++) {
        const double z = 2 * sdm_rng_uniform(seed, 0, i) - 1, r = sqrt(1 - z * z),
                     turn = 2 * PI * sdm_rng_uniform(seed, 1, i);
        double by = noise * sdm_rng_normal(seed, 2, i);
        // Student's t with four degrees of freedom, scaled to the same variance
        if (kind == LONG_TAILED) {
            double square = 0;
            for (uint64_t k = 3; k < 7; k++) square += pow(sdm_rng_normal(seed, k, i), 2) / 4;
            by /= sqrt(2 * square);
        }
        foot[i][0] = RADIUS * r * cos(turn), foot[i][1] = RADIUS * r * sin(turn);
        foot[i][2] = RADIUS * z;
        distance[i] = by + wave * sqrt(2) * sin(2 * PI * foot[i][2] / RADIUS + 1);
        for (size_t a = 0; a < 3; a++) place[i][a] = foot[i][a] * (1 + distance[i] / RADIUS);
    }
    fit_shared_errors e;
    sdm_fit_shared_errors_of((const double(*)[3])place, (const double(*)[3])foot, distance, n,
                             0.005 * RADIUS, &e);
    free(place);
    free(foot);
    free(distance);
    return e;
}

// Of 4,400 right fits none is doubted, and the mean of the ratio is 1, or up to 10 % more by
// places.
static void test_independent_errors_are_not_shared(void **state)
{
    (void)state;
    static const size_t sizes[] = {100, 200, 500, 1500};
    for (size_t c = 0; c < 4; c++)
        for (int kind = 0; kind < 2; kind++) {
            const size_t n = sizes[c], fits = c < 2 ? 1000 : c < 3 ? 150 : 50;
            double mean = 0;
            for (size_t seed = 1; seed <= fits; seed++) {
                const fit_shared_errors e = ball(n, seed, NOISE, 0, (tails)kind);
                if (!(e.ratio <= e.limit))
                    fail_msg("%zu points, kind %d: %g, limit %g", n, kind, e.ratio, e.limit);
                mean += e.ratio / (double)fits;
            }
            if (!(mean > 0.95 && mean < 1.1))
                fail_msg("%zu points, kind %d: mean ratio %g", n, kind, mean);
        }
}

// A difference of three times the noise is found, with both figures; one of half of it is none.
static void test_a_smooth_difference_is_found(void **state)
{
    (void)state;
    static const size_t sizes[] = {1500, 4000, MOST};
    for (size_t c = 0; c < 3; c++)
        for (uint64_t seed = 1; seed <= 3; seed++) {
            const fit_shared_errors e = ball(sizes[c], seed, NOISE, 3 * NOISE, NORMAL),
                                    small = ball(sizes[c], seed, NOISE, 0.5 * NOISE, NORMAL);
            const double all = NOISE * sqrt(1 + 9);
            if (!(e.ratio > e.limit) || fabs(e.all / all - 1) > 0.08 || e.near < 0.95 * NOISE ||
                e.near > (c ? 1.1 : 1.3) * NOISE)
                fail_msg("%zu points: %g, limit %g: %g mm and %g mm", sizes[c], e.ratio, e.limit,
                         e.near, e.all);
            assert_true(small.ratio <= small.limit);
        }
}

// Points that scatter four times as far as they lie apart: their nearest ones in space have the
// same errors.
static void test_dense_points_share_no_errors(void **state)
{
    (void)state;
    for (uint64_t seed = 1; seed <= 5; seed++) {
        const fit_shared_errors e = ball(4000, seed, 0.3, 0, NORMAL);
        if (fabs(e.ratio - 1) > 0.15) fail_msg("seed %zu: %g", (size_t)seed, e.ratio);
    }
}

// Where the feet are wrong, as beside edges, neighbours as they lie tell.
static void test_neighbours_as_they_lie(void **state)
{
    (void)state;
    enum { N = 700 };
    static double place[N][3], foot[N][3], distance[N];
    const double noise = 0.02, wave = 0.06;
    for (size_t i = 0; i < N; i++) {
        const double z = 2 * sdm_rng_uniform(1, 0, i) - 1, r = sqrt(1 - z * z),
                     turn = 2 * PI * sdm_rng_uniform(1, 1, i);
        place[i][0] = RADIUS * r * cos(turn), place[i][1] = RADIUS * r * sin(turn);
        place[i][2] = RADIUS * z;
        for (size_t a = 0; a < 3; a++) foot[i][a] = 3 * sdm_rng_normal(2, a, i);
        distance[i] = noise * sdm_rng_normal(3, 0, i) +
                      wave * sqrt(2) * sin(2 * PI * place[i][2] / RADIUS + 1);
    }
    fit_shared_errors e;
    sdm_fit_shared_errors_of((const double(*)[3])foot, (const double(*)[3])foot, distance, N, 0,
                             &e);
    assert_true(e.ratio < 1.3);
    sdm_fit_shared_errors_of((const double(*)[3])place, (const double(*)[3])foot, distance, N, 0,
                             &e);
    if (!(e.ratio > e.limit) || e.near > 2 * noise || e.near < 0.9 * noise)
        fail_msg("%g, limit %g: %g mm and %g mm", e.ratio, e.limit, e.near, e.all);
}

static void test_facets_are_no_difference(void **state)
{
    (void)state;
    const fit_shared_errors e = ball(4000, 1, 0, 0.005 * RADIUS, NORMAL);
    assert_true(e.ratio <= e.limit && e.near < 0.1 * e.all);
}

// Few points tell nothing. Points that are given twice are no neighbours of each other.
static void test_few_and_double_points(void **state)
{
    (void)state;
    enum { N = 400 };
    double foot[2 * N][3], distance[2 * N];
    assert_int_equal(ball(99, 1, NOISE, 3 * NOISE, NORMAL).n, 0);
    for (size_t i = 0; i < N; i++) {
        for (uint64_t a = 0; a < 3; a++) foot[i][a] = sdm_rng_uniform(1, a, i);
        distance[i] = NOISE * sdm_rng_normal(2, 0, i);
    }
    memcpy(foot + N, foot, N * sizeof *foot);
    memcpy(distance + N, distance, N * sizeof *distance);
    fit_shared_errors once, twice;
    sdm_fit_shared_errors_of((const double(*)[3])foot, (const double(*)[3])foot, distance, N, 0,
                             &once);
    sdm_fit_shared_errors_of((const double(*)[3])foot, (const double(*)[3])foot, distance,
                             2 * (size_t)N, 0, &twice);
    assert_true(fabs(once.ratio / twice.ratio - 1) < 1e-9);
}

/* A fit to points of an object that is bent by 0.1 mm, and to points of the shape. `*found`: its
 * finding. */
static void fit_bent(double bend, double noise, bool keep_sd, sdm_fit_finding *found)
{
    enum { N = 1500 };
    sdm_mesh mesh = {0};
    static double x[3 * N];
    assert_int_equal(sdm_instance_mesh(ellipsoid, TRUTH, &mesh, NULL), SDM_OK);
    assert_int_equal(sdm_fit_surface_points(&mesh, N, 3, x, NULL), SDM_OK);
    sdm_mesh_dispose(&mesh);
    for (size_t i = 0; i < N; i++) {
        double y[3];
        for (size_t a = 0; a < 3; a++) y[a] = x[3 * i + a] + noise * sdm_rng_normal(6, a, i);
        y[2] += bend * y[0] * y[0];
        sdm_pose_apply(&POSE, y, x + 3 * i);
    }
    const sdm_fit_source source = exact_source();
    const sdm_fit_target t = {.kind = SDM_FIT_POINTS, .points = x, .n_points = N};
    sdm_fit_opts o = near_start();
    if (keep_sd) o.keep_appearance = true, o.point_sd = 0.04;
    sdm_fit_result r;
    sdm_error err = {0};
    if (sdm_fit(&source, &t, &o, &r, &err)) fail_msg("%s", err.text);
    *found = (sdm_fit_finding){0};
    for (size_t i = 0; i < r.verdict.n_findings; i++)
        if (r.verdict.findings[i].kind == SDM_FIT_CHECK_RESIDUALS) *found = r.verdict.findings[i];
    sdm_fit_dispose(&r);
}

static void test_a_fit_tells_both_figures(void **state)
{
    (void)state;
    sdm_fit_finding f;
    double near = 0, all = 0;
    fit_bent(0.03, 0.015, false, &f);
    if (f.grade != SDM_FIT_DOUBTFUL ||
        sscanf(f.text, "neighbouring points scatter by %lf mm, all points by %lf mm about", &near,
               &all) != 2 ||
        fabs(near / 0.015 - 1) > 0.4 || !(all > 1.5 * near))
        fail_msg("%d, %g, limit %g: %s", f.grade, f.figure, f.limit, f.text);
    fit_bent(0, 0.015, false, &f);
    if (f.grade != SDM_FIT_PASSED) fail_msg("%g, limit %g: %s", f.figure, f.limit, f.text);
    // a scanner that is known to err by so much
    fit_bent(0.03, 0.015, true, &f);
    if (f.grade != SDM_FIT_PASSED) fail_msg("%g, limit %g: %s", f.figure, f.limit, f.text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_independent_errors_are_not_shared),
        cmocka_unit_test(test_a_smooth_difference_is_found),
        cmocka_unit_test(test_dense_points_share_no_errors),
        cmocka_unit_test(test_neighbours_as_they_lie),
        cmocka_unit_test(test_facets_are_no_difference),
        cmocka_unit_test(test_few_and_double_points),
        cmocka_unit_test(test_a_fit_tells_both_figures),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
