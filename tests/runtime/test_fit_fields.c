/* Smoothing and interpolation of fields against closed forms.
 * Tests: interpolate.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "fit/data/blur.h"
#include "fit/data/interpolate.h"
#include "sdm/internal/rng.h"
#include "sdm/pose.h"

static void *array_new(size_t n, size_t size)
{
    void *p = calloc(n, size);
    if (!p) abort();
    return p;
}

static void test_blur_keeps_its_closed_forms(void **state)
{
    (void)state;
    const sdm_grid g = sdm_grid_centred((int64_t[3]){33, 31, 29}, 0.2, (double[3]){0, 0, 0});
    const size_t n = sdm_grid_count(&g), middle = (size_t)((14 * 31 + 15) * 33 + 16);
    for (double variance = 0.002; variance < 0.3; variance *= 3) {
        double *f = array_new(2 * n, sizeof *f), *spare = array_new(2 * n, sizeof *f);
        f[2 * middle] = 1;
        sdm_fit_blur(&g, 2, variance, false, 2, &f, &spare);
        double sum = 0, second[3] = {0, 0, 0};
        for (size_t i = 0; i < n; i++) {
            const double at[3] = {(double)(i % 33) - 16, (double)(i / 33 % 31) - 15,
                                  (double)(i / 33 / 31) - 14};
            sum += f[2 * i];
            for (int a = 0; a < 3; a++) second[a] += f[2 * i] * at[a] * at[a] * 0.04;
        }
        assert_true(fabs(sum - 1) < 1e-5);
        for (int a = 0; a < 3; a++)
            assert_true(fabs(second[a] / variance - 1) < (variance < 0.2 ? 1e-3 : 3e-2));
        free(f);
        free(spare);
    }
    // A kernel wider than the maximal number of taps is truncated; its weights still sum to 1.
    double *f = array_new(n, sizeof *f), *spare = array_new(n, sizeof *f);
    for (size_t i = 0; i < n; i++) f[i] = 7;
    sdm_fit_blur(&g, 1, 1e18, false, 2, &f, &spare);
    for (size_t i = 0; i < n; i++) assert_true(fabs(f[i] - 7) < 1e-9);
    free(f);
    free(spare);
}

static void test_interpolation_is_exact_for_quadratics(void **state)
{
    (void)state;
    sdm_grid g = sdm_grid_centred((int64_t[3]){9, 8, 7}, 0.3, (double[3]){0.2, -0.1, 0.4});
    g.spacing[1] = 0.25;
    sdm_pose_matrix(&(sdm_pose){{0.3, -0.5, 0.2}, {0, 0, 0}}, g.dir);
    const size_t n = sdm_grid_count(&g);
    double *f = array_new(2 * n, sizeof *f);
    for (size_t i = 0; i < n; i++) {
        double x[3];
        sdm_grid_world(
            &g, (const double[3]){(double)(i % 9), (double)(i / 9 % 8), (double)(i / 9 / 8)}, x);
        // A quadratic function: interpolation is exact.
        f[2 * i] = 1 + x[0] - 2 * x[1] + x[0] * x[1] + 0.5 * x[2] * x[2];
        f[2 * i + 1] = 3 - x[2];
    }
    const fit_field field = {.grid = &g, .packed = f, .n_fields = 2, .distance = true};
    for (int i = 0; i < 50; i++) {
        double index[3], x[3], slope[3];
        double rest;
        for (uint64_t k = 0; k < 3; k++)
            index[k] = 1 + (double)(g.n[k] - 3) * sdm_rng_uniform(1, (uint64_t)i, k);
        sdm_grid_world(&g, index, x);
        const double v = sdm_fit_interpolate_all(&field, x, slope, &rest);
        assert_true(fabs(v - (1 + x[0] - 2 * x[1] + x[0] * x[1] + 0.5 * x[2] * x[2])) < 2e-6);
        assert_true(fabs(slope[0] - (1 + x[1])) < 2e-5 && fabs(slope[1] - (x[0] - 2)) < 2e-5 &&
                    fabs(slope[2] - x[2]) < 2e-5);
        assert_true(fabs(rest - (3 - x[2])) < 1e-6);
    }
    // Outside of the grid: the value at the border plus the distance to it.
    double corner[3], out[3], slope[3];
    double rest;
    sdm_grid_world(&g, (const double[3]){8, 7, 6}, corner);
    sdm_grid_world(&g, (const double[3]){8 + 3 / 0.3, 7 + 4 / 0.25, 6}, out);
    assert_true(fabs(sdm_fit_interpolate(&field, out) - sdm_fit_interpolate(&field, corner) - 5) <
                1e-5);
    (void)sdm_fit_interpolate_all(&field, out, slope, &rest);
    assert_true(fabs(slope[0] * (out[0] - corner[0]) + slope[1] * (out[1] - corner[1]) +
                     slope[2] * (out[2] - corner[2]) - 5) < 1e-4);
    free(f);
}

/* An impulse, smoothed and interpolated: the sum over any shifted lattice is 1, and the second
 * moment is the variance. Narrow Gaussians, sharpened to compensate for the B-splines, vanish at
 * a distance. */
static void test_splines_keep_moments(void **state)
{
    (void)state;
    sdm_grid g = sdm_grid_centred((int64_t[3]){33, 31, 29}, 0.2, (double[3]){0, 0, 0});
    g.spacing[1] = 0.25;
    const int64_t *n = g.n;
    const size_t count = sdm_grid_count(&g), middle = (size_t)((14 * n[1] + 15) * n[0] + 16);
    for (double variance = 0.002; variance < 0.1; variance *= 3) {
        double *f = array_new(2 * count, sizeof *f), *spare = array_new(2 * count, sizeof *f);
        f[2 * middle] = f[2 * middle + 1] = 1;
        sdm_fit_blur(&g, 2, variance, true, 2, &f, &spare);
        const fit_field field = {.grid = &g, .packed = f, .n_fields = 2};
        const double off[3] = {sdm_rng_uniform(1, 2, 3), sdm_rng_uniform(1, 2, 4),
                               sdm_rng_uniform(1, 2, 5)};
        double centre[3], sum = 0, second[3] = {0, 0, 0};
        sdm_grid_world(&g, (const double[3]){16, 15, 14}, centre);
        for (int64_t i = 0; i < (n[0] - 1) * (n[1] - 1) * (n[2] - 1); i++) {
            const int64_t at[3] = {i % (n[0] - 1), i / (n[0] - 1) % (n[1] - 1),
                                   i / (n[0] - 1) / (n[1] - 1)};
            double x[3];
            sdm_grid_world(&g,
                           (const double[3]){(double)at[0] + off[0], (double)at[1] + off[1],
                                             (double)at[2] + off[2]},
                           x);
            const double v = sdm_fit_interpolate(&field, x);
            sum += v;
            for (int a = 0; a < 3; a++) second[a] += v * (x[a] - centre[a]) * (x[a] - centre[a]);
            if (variance < 0.01 && fabs((double)at[0] + off[0] - 16) > 12) assert_true(v == 0);
        }
        assert_true(fabs(sum - 1) < 1e-6);
        for (int a = 0; a < 3; a++) assert_true(fabs(second[a] / variance - 1) < 1e-3);
        free(f);
        free(spare);
    }
}

// Derivatives of splines against differences; second derivatives are continuous across voxel
// centres.
static void test_splines_have_right_derivatives(void **state)
{
    (void)state;
    sdm_grid g = sdm_grid_centred((int64_t[3]){9, 8, 7}, 0.3, (double[3]){0.2, -0.1, 0.4});
    sdm_pose_matrix(&(sdm_pose){{0.3, -0.5, 0.2}, {0, 0, 0}}, g.dir);
    const size_t n = sdm_grid_count(&g);
    double *f = array_new(2 * n, sizeof *f);
    for (size_t i = 0; i < 2 * n; i++) f[i] = sdm_rng_uniform(1, 7, i);
    const fit_field field = {.grid = &g, .packed = f, .n_fields = 2};
    for (int i = 0; i < 50; i++) {
        double index[3], x[3], slope[3], rest;
        for (uint64_t k = 0; k < 3; k++)
            index[k] = 0.1 + ((double)g.n[k] - 1.2) * sdm_rng_uniform(2, (uint64_t)i, k);
        sdm_grid_world(&g, index, x);
        (void)sdm_fit_interpolate_all(&field, x, slope, &rest);
        for (int a = 0; a < 3; a++) {
            double after[3] = {x[0], x[1], x[2]}, before[3] = {x[0], x[1], x[2]};
            after[a] += 1e-5, before[a] -= 1e-5;
            const double difference =
                (sdm_fit_interpolate(&field, after) - sdm_fit_interpolate(&field, before)) / 2e-5;
            assert_true(fabs(difference - slope[a]) < 1e-7);
        }
    }
    double second[2];
    // On either side of a voxel centre.
    for (int side = 0; side < 2; side++) {
        double slope[2][3], rest;
        for (int i = 0; i < 2; i++) {
            double x[3];
            sdm_grid_world(&g, (const double[3]){4 + (side ? 1e-6 : -1e-6) * (1 + i), 3.3, 3.6}, x);
            (void)sdm_fit_interpolate_all(&field, x, slope[i], &rest);
        }
        second[side] = (side ? 1 : -1) * (slope[1][0] - slope[0][0]) / 1e-6;
    }
    assert_true(fabs(second[1] - second[0]) < 1e-3 * fabs(second[0]));
    free(f);
}

// A plane edge blurred by 2/3 voxel (sd), sampled at voxels and interpolated at offsets in between.
static void test_splines_reproduce_an_edge(void **state)
{
    (void)state;
    const sdm_grid g = sdm_grid_centred((int64_t[3]){24, 1, 1}, 1, (double[3]){11.5, 0, 0});
    double most = 0;
    for (double shift = 0; shift < 1; shift += 0.125) {
        double *f = array_new(24, sizeof *f), *spare = array_new(24, sizeof *f);
        for (int i = 0; i < 24; i++) f[i] = 0.5 * erfc((i - 11.5 - shift) / (0.5 * sqrt(2)));
        sdm_fit_blur(&g, 1, 4.0 / 9 - 0.25, true, 1, &f, &spare);
        const fit_field field = {.grid = &g, .packed = f, .n_fields = 1};
        for (double x = 4; x < 19; x += 0.1) {
            const double v = sdm_fit_interpolate(&field, (const double[3]){x, 0, 0});
            most = fmax(most, fabs(v - 0.5 * erfc((x - 11.5 - shift) / (2.0 / 3 * sqrt(2)))));
        }
        free(f);
        free(spare);
    }
    if (!(most < 0.03)) fail_msg("off by %g", most); // for comparison: cubic convolution has 0.035
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_blur_keeps_its_closed_forms),
        cmocka_unit_test(test_interpolation_is_exact_for_quadratics),
        cmocka_unit_test(test_splines_keep_moments),
        cmocka_unit_test(test_splines_have_right_derivatives),
        cmocka_unit_test(test_splines_reproduce_an_edge),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
