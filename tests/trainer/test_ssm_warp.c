/* Thin-plate warps in space against a plain solution of their linear system in long double.
 * Tests: warp.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/rng.h"
#include "sdm/internal/ssm_build.h"

enum { N = 9, SHAPES = 2, VERTICES = 20, ROWS = N + 4 };

// reproducible coordinates in -5 .. 5
static void scatter(uint64_t seed, size_t n, double *x)
{
    for (size_t i = 0; i < 3 * n; i++) x[i] = 10 * (sdm_rng_uniform(seed, 0, i) - 0.5);
}

static long double between(const double *x, const double *y)
{
    long double square = 0;
    for (int d = 0; d < 3; d++) square += ((long double)x[d] - y[d]) * ((long double)x[d] - y[d]);
    return sqrtl(square);
}

// Solves a[ROWS][ROWS] x = b[ROWS] in place of b, by elimination with pivots.
static void eliminate(long double a[ROWS][ROWS], long double b[ROWS])
{
    for (int k = 0; k < ROWS; k++) {
        int pivot = k;
        for (int i = k + 1; i < ROWS; i++)
            if (fabsl(a[i][k]) > fabsl(a[pivot][k])) pivot = i;
        for (int j = 0; j < ROWS; j++) {
            const long double swap = a[k][j];
            a[k][j] = a[pivot][j], a[pivot][j] = swap;
        }
        const long double swap = b[k];
        b[k] = b[pivot], b[pivot] = swap;
        for (int i = k + 1; i < ROWS; i++) {
            const long double f = a[i][k] / a[k][k];
            for (int j = k; j < ROWS; j++) a[i][j] -= f * a[k][j];
            b[i] -= f * b[k];
        }
    }
    for (int k = ROWS - 1; k >= 0; k--) {
        for (int j = k + 1; j < ROWS; j++) b[k] -= a[k][j] * b[j];
        b[k] /= a[k][k];
    }
}

// Coordinate d of the spline at x: sum of weights |x - from|, and a linear function.
static double spline(const double *from, const double *to, int d, const double x[3])
{
    long double a[ROWS][ROWS] = {{0}}, b[ROWS] = {0}, value = 0;
    for (int i = 0; i < N; i++) {
        for (int j = 0; j < N; j++) a[i][j] = between(from + 3 * i, from + 3 * j);
        for (int k = 0; k < 4; k++) a[i][N + k] = a[N + k][i] = k ? from[3 * i + k - 1] : 1;
        b[i] = to[3 * i + d];
    }
    eliminate(a, b);
    for (int i = 0; i < N; i++) value += b[i] * between(x, from + 3 * i);
    for (int k = 0; k < 4; k++) value += b[N + k] * (k ? x[k - 1] : 1);
    return (double)value;
}

static void test_against_the_system(void **state)
{
    (void)state;
    double from[3 * N], to[SHAPES * 3 * N], vert[3 * VERTICES], out[SHAPES * 3 * VERTICES];
    scatter(1, N, from);
    scatter(2, SHAPES * N, to);
    scatter(3, VERTICES, vert);
    memcpy(vert, from, sizeof from); // the first vertices are the points
    sdm_error err = {0};
    if (sdm_ssm_warp(N, from, SHAPES, to, VERTICES, vert, out, &err)) fail_msg("%s", err.text);
    for (size_t k = 0; k < SHAPES; k++)
        for (size_t v = 0; v < VERTICES; v++)
            for (int d = 0; d < 3; d++) {
                const double w = out[3 * (VERTICES * k + v) + (size_t)d];
                assert_true(fabs(w - spline(from, to + 3 * N * k, d, vert + 3 * v)) < 1e-9);
                if (v < N) assert_true(fabs(w - to[3 * (N * k + v) + (size_t)d]) < 1e-9);
            }
}

// A linear map of the points moves everything else by the same map, also far away.
static void test_linear_maps(void **state)
{
    (void)state;
    const double m[3][4] = {{1.1, 0.2, 0, 3}, {-0.1, 0.9, 0.3, -2}, {0, 0.4, 1.2, 1}};
    double from[3 * N], to[3 * N], vert[3 * VERTICES], out[3 * VERTICES];
    scatter(4, N, from);
    scatter(5, VERTICES, vert);
    for (size_t i = 0; i < 3; i++) vert[i] = 100;
    for (size_t i = 0; i < N; i++)
        for (size_t d = 0; d < 3; d++)
            to[3 * i + d] = m[d][3] + m[d][0] * from[3 * i] + m[d][1] * from[3 * i + 1] +
                            m[d][2] * from[3 * i + 2];
    assert_int_equal(sdm_ssm_warp(N, from, 1, to, VERTICES, vert, out, NULL), SDM_OK);
    for (size_t v = 0; v < VERTICES; v++)
        for (size_t d = 0; d < 3; d++) {
            const double *x = vert + 3 * v,
                         y = m[d][3] + m[d][0] * x[0] + m[d][1] * x[1] + m[d][2] * x[2];
            assert_true(fabs(out[3 * v + d] - y) < 1e-9);
        }
}

static void test_points_that_are_refused(void **state)
{
    (void)state;
    double from[3 * N], out[3];
    const double vert[3] = {0, 0, 0};
    sdm_error err = {0};
    scatter(6, N, from);
    assert_int_equal(sdm_ssm_warp(3, from, 1, from, 1, vert, out, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "3 points, a warp needs 4"));
    memcpy(from + 3 * 4, from + 3, 3 * sizeof *from);
    assert_int_equal(sdm_ssm_warp(N, from, 1, from, 1, vert, out, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "points 2 and 5 are at the same place"));
    scatter(6, N, from);
    for (size_t i = 0; i < N; i++) from[3 * i + 2] = from[3 * i] - 2 * from[3 * i + 1];
    assert_int_equal(sdm_ssm_warp(N, from, 1, from, 1, vert, out, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "in one plane"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_against_the_system),
        cmocka_unit_test(test_linear_maps),
        cmocka_unit_test(test_points_that_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
