/* Masking of cavities next to the shape: against brute force, and in fits.
 * Tests: cavity.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "fit/data/cavity.h"
#include "oracle/fit_tools.h"
#include "sdm/memory.h"

enum { NX = 17, NY = 13, NZ = 11, COUNT = NX * NY * NZ };

/* Distance in mm between voxels a and b. */
static double voxel_distance(const sdm_grid *g, size_t a, size_t b)
{
    const double d[3] = {g->spacing[0] * ((double)(a % NX) - (double)(b % NX)),
                         g->spacing[1] * ((double)(a / NX % NY) - (double)(b / NX % NY)),
                         g->spacing[2] * ((double)(a / NX / NY) - (double)(b / NX / NY))};
    return sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
}

// Random dark images with a few bright and NaN voxels: the mask equals the union of all balls of
// the given radius that contain no bright voxel.
static void test_mask_matches_brute_force(void **state)
{
    (void)state;
    sdm_grid g = sdm_grid_centred((int64_t[3]){NX, NY, NZ}, 1, (double[3]){0, 0, 0});
    g.spacing[0] = 0.3, g.spacing[1] = 0.4, g.spacing[2] = 0.5;
    sdm_fit_opts o = sdm_fit_defaults();
    o.blur = 1e-4;
    for (uint64_t seed = 0; seed < 6; seed++) {
        o.cavity = 0.83 + 0.21 * (double)seed;
        float image[COUNT], *found;
        bool wall[COUNT], centre[COUNT];
        for (size_t i = 0; i < COUNT; i++) {
            const double u = sdm_rng_uniform(3, seed, i);
            image[i] = u < 0.02 ? 1300 : u < 0.022 ? NAN : 40;
            wall[i] = !(image[i] < 100);
        }
        for (size_t i = 0; i < COUNT; i++) {
            centre[i] = true;
            for (size_t k = 0; k < COUNT; k++)
                if (wall[k] && voxel_distance(&g, i, k) < o.cavity) centre[i] = false;
        }
        const sdm_fit_target t = {.kind = SDM_FIT_IMAGE, .grid = g, .values = image};
        size_t n, expected = 0, all = 0;
        double widest, radius = 0; // the widest ball, up to the next wall
        for (size_t i = 0; i < COUNT; i++) {
            double next = INFINITY;
            for (size_t k = 0; k < COUNT; k++)
                if (wall[k]) next = fmin(next, voxel_distance(&g, i, k));
            radius = fmax(radius, next);
        }
        o.n_threads = 1 + (int)(seed % 3);
        assert_int_equal(sdm_fit_mask_cavities(&t, &o, &found, &n, &widest, NULL), SDM_OK);
        assert_true(fabs(widest - radius) < 1e-6);
        for (size_t i = 0; i < COUNT; i++) {
            bool out = false;
            for (size_t k = 0; k < COUNT; k++)
                out = out || (centre[k] && voxel_distance(&g, i, k) < o.cavity);
            expected += out;
            all += !wall[i];
            assert_int_equal(isnan(found[i]), out || isnan(image[i]));
            if (!out && !isnan(image[i])) assert_true(found[i] == image[i]);
        }
        assert_int_equal(n, expected);
        assert_true(n > 0 && n < all);
        sdm_free(found);
    }
}

// A phantom with a large dark ball that merges with one end of the ellipsoid.
static float *ball_phantom(void)
{
    float *v = phantom(TRUTH, &POSE, 0.3, 7);
    const sdm_grid g = image_grid();
    double centre[3];
    sdm_pose_apply(&POSE, (const double[3]){4.5, 0, 0}, centre);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) {
        const double index[3] = {(double)(i % 36), (double)(i / 36 % 30), (double)(i / 36 / 30)};
        double x[3], square = 0;
        sdm_grid_world(&g, index, x);
        for (int k = 0; k < 3; k++) square += (x[k] - centre[k]) * (x[k] - centre[k]);
        const double share = 0.5 * erfc((sqrt(square) - 2.3) / (0.2 * 1.4142135623730951));
        v[i] += (float)(share * (40 - (double)v[i]));
    }
    return v;
}

/* Largest error of parameters (mm), rotation (rad) and translation (mm). */
static double largest_error(const sdm_fit_result *r)
{
    double e[9], most = 0;
    errors(r, TRUTH, &POSE, e);
    for (int k = 0; k < 9; k++) most = fmax(most, fabs(e[k]));
    return most;
}

static void test_mask_removes_the_bias(void **state)
{
    (void)state;
    float *v = ball_phantom();
    const sdm_fit_target t = image_of(v);
    const sdm_fit_source source = exact_source();
    sdm_fit_opts o = near_start();
    o.eps = o.polish_eps = 1e-3;
    sdm_fit_result with, without;
    sdm_error err = {0};
    o.max_iterations = 20;
    (void)sdm_fit(&source, &t, &o, &without, &err);
    o.max_iterations = 60;
    o.cavity = 1.8;
    if (sdm_fit(&source, &t, &o, &with, &err)) fail_msg("%s", err.text);
    assert_true(without.n_cavity == 0 && with.n_cavity > 500 && with.n_nan > 100);
    if (!(largest_error(&with) < 0.1 && largest_error(&without) > 0.4))
        fail_msg("off by %g with, %g without", largest_error(&with), largest_error(&without));
    sdm_fit_dispose(&with);
    sdm_fit_dispose(&without);
    free(v);
}

// A cavity radius smaller than the shape's would mask the shape itself: refused with advice.
static void test_radius_below_shape_is_refused(void **state)
{
    (void)state;
    float *v = phantom(TRUTH, &POSE, 0.3, 7);
    const sdm_fit_target t = image_of(v);
    const sdm_fit_source source = exact_source();
    sdm_fit_opts o = near_start();
    o.keep_params = true;
    o.start_params = TRUTH;
    o.cavity = 1.1;
    o.least_inside = 0;
    sdm_fit_result r;
    sdm_error err = {0};
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_QUALITY);
    if (!strstr(err.text, "give a radius above that of the shape")) fail_msg("%s", err.text);
    sdm_fit_dispose(&r);
    o.cavity = -1;
    assert_int_equal(sdm_fit(&source, &t, &o, &r, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "cavity is -1"));
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_mask_matches_brute_force),
                                       cmocka_unit_test(test_mask_removes_the_bias),
                                       cmocka_unit_test(test_radius_below_shape_is_refused)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
