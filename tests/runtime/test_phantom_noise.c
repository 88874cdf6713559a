/* Phantoms: noise and random truth against their distributions; reproducible bits, wrong arguments,
 * failing allocations, cancellation.
 * Tests: phantom_air.c phantom_filter.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/phantom_tools.h"
#include "sdm/internal/heap.h"

typedef struct statistics {
    double mean, variance, rho[3]; /* correlation of neighbours along x, y, z */
} statistics;

static statistics measure(const float *v, const sdm_grid *g)
{
    const size_t n = sdm_grid_count(g), step[3] = {1, (size_t)g->n[0], (size_t)(g->n[0] * g->n[1])};
    statistics s = {0};
    for (size_t i = 0; i < n; i++) s.mean += (double)v[i] / (double)n;
    for (size_t i = 0; i < n; i++)
        s.variance += ((double)v[i] - s.mean) * ((double)v[i] - s.mean) / (double)n;
    for (int a = 0; a < 3; a++) {
        double sum = 0, count = 0;
        for (size_t i = 0; i + step[a] < n; i++) {
            const size_t at = i / step[a] % (size_t)g->n[a];
            if (at + 1 == (size_t)g->n[a]) continue;
            sum += ((double)v[i] - s.mean) * ((double)v[i + step[a]] - s.mean);
            count++;
        }
        s.rho[a] = sum / count / s.variance;
    }
    return s;
}

static void test_noise_has_its_statistics(void **state)
{
    (void)state;
    // Only tissue outside of the shape.
    const double far[3] = {200, 0, 0};
    sdm_grid g = sdm_grid_centred((const int64_t[3]){40, 44, 48}, 0.2, far);
    const double n = (double)sdm_grid_count(&g), h[3] = {0.25, 0.2, 0.3};
    for (int a = 0; a < 3; a++) g.spacing[a] = h[a];

    sdm_phantom_opts o = plain();
    o.outside = (sdm_tissue){100, 0};
    o.noise = 30;
    float *white = make(block, NULL, NULL, &o, &g, NULL);
    statistics s = measure(white, &g);
    close_to("mean", s.mean, 100, 4 * 30 / sqrt(n));
    close_to("variance", s.variance, 900, 4 * 900 * sqrt(2 / n));
    for (int a = 0; a < 3; a++) close_to("correlation of white noise", s.rho[a], 0, 4 / sqrt(n));

    // Smoothed white noise: the correlation of neighbours is exp(-h^2 / (4 sigma^2)), the variance
    // as configured.
    o.noise_is_blurred = true;
    const double blur[3] = {0.2, 0.3, 0.25};
    double independent = n; // effective number of independent voxels
    for (int a = 0; a < 3; a++) {
        o.blur[a] = blur[a];
        independent *= fmin(1, g.spacing[a] / (2 * sqrt(PI) * blur[a]));
    }
    float *smooth = make(block, NULL, NULL, &o, &g, NULL);
    s = measure(smooth, &g);
    close_to("mean", s.mean, 100, 4 * 30 / sqrt(independent));
    close_to("variance", s.variance, 900, 4 * 900 * sqrt(2 / independent));
    for (int a = 0; a < 3; a++)
        close_to("correlation of noise", s.rho[a], exp(-0.25 * h[a] * h[a] / (blur[a] * blur[a])),
                 0.03);

    // Texture is an independent field with the tissue's sd; the variances of texture and noise add.
    o.noise = 0;
    o.outside.sd = 40;
    o.texture_mm = 0.3;
    float *texture = make(block, NULL, NULL, &o, &g, NULL);
    s = measure(texture, &g);
    close_to("variance", s.variance, 1600, 0.1 * 1600);
    for (int a = 0; a < 3; a++)
        close_to("correlation of texture", s.rho[a], exp(-0.25 * h[a] * h[a] / 0.09), 0.03);
    double both = 0;
    for (size_t i = 0; i < (size_t)n; i++)
        both += ((double)texture[i] - 100) * ((double)smooth[i] - 100) / n;
    close_to("correlation of texture and noise", both / (30 * 40), 0, 0.06);
    o.noise = 30;
    float *sum = make(block, NULL, NULL, &o, &g, NULL);
    for (size_t i = 0; i < (size_t)n; i++)
        close_to("sum", (double)sum[i], (double)texture[i] + (double)smooth[i] - 100, 1e-3);

    // Both white: still two fields whose variances add.
    o.texture_mm = 0;
    o.noise_is_blurred = false;
    float *two = make(block, NULL, NULL, &o, &g, NULL);
    s = measure(two, &g);
    close_to("variance of two fields", s.variance, 2500, 4 * 2500 * sqrt(2 / n));

    // Tissue inside has its own texture.
    o = plain();
    o.inside = (sdm_tissue){-500, 10};
    o.outside = (sdm_tissue){0, 40};
    for (int a = 0; a < 3; a++) g.origin[a] -= far[a];
    g.origin[0] -= 30; // all voxels are inside
    float *inside = make(block, NULL, NULL, &o, &g, NULL);
    s = measure(inside, &g);
    close_to("mean inside", s.mean, -500, 4 * 10 / sqrt(n));
    close_to("variance inside", s.variance, 100, 4 * 100 * sqrt(2 / n));
    free(inside);
    free(two);
    free(sum);
    free(texture);
    free(smooth);
    free(white);
}

static void test_same_bits(void **state)
{
    (void)state;
    const sdm_pose pose = {.rotation = {0.2, 0.1, 0.4}, .translation = {0.1, 0.2, 0.3}};
    const sdm_grid g = oblique(21, 33, 15);
    const size_t n = sdm_grid_count(&g);
    sdm_phantom_opts o = sdm_phantom_defaults();
    o.air_share = 0.6;
    o.n_threads = 1;
    uint8_t *first = calloc(n, 1), *label = calloc(n, 1);
    if (!first || !label) abort();
    float *one = make(ellipsoid, NULL, &pose, &o, &g, first);
    for (o.n_threads = 0; o.n_threads <= 3; o.n_threads++) {
        float *v = make(ellipsoid, NULL, &pose, &o, &g, label);
        assert_memory_equal(v, one, n * sizeof *v);
        assert_memory_equal(label, first, n);
        free(v);
    }
    o.n_threads = 2;
    o.seed = 2;
    float *v = make(ellipsoid, NULL, &pose, &o, &g, label);
    assert_memory_not_equal(v, one, n * sizeof *v);
    assert_memory_equal(label, first, n);
    free(v);
    free(one);
    free(label);
    free(first);
}

static void test_random_truth_has_its_distribution(void **state)
{
    (void)state;
    double p[3], again[3], mean[3] = {0}, angle = 0, shift = 0, widest = 0;
    enum { N = 2000 };
    for (uint64_t seed = 0; seed < N; seed++) {
        sdm_phantom_random_params(ellipsoid, seed, p);
        assert_int_equal(sdm_instance_check(ellipsoid, p, NULL), SDM_OK);
        for (int i = 0; i < 3; i++) mean[i] += p[i] / N;
        const sdm_pose pose = sdm_phantom_random_pose(0.5, 2, seed);
        const double *r = pose.rotation, *t = pose.translation;
        const double turned = sqrt(r[0] * r[0] + r[1] * r[1] + r[2] * r[2]);
        const double moved = sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]);
        assert_true(turned <= 0.5 * (1 + 1e-12) && moved <= 2 * (1 + 1e-12));
        angle += turned / N;
        shift += moved / N;
        widest = fmax(widest, turned);
    }
    // Means of uniform distributions, and 3/4 for the radius in a ball; each bound is four standard
    // errors.
    close_to("mean rx", mean[0], 3, 4 * 4 / sqrt(12.0 * N));
    close_to("mean ry", mean[1], 2.5, 4 * 3 / sqrt(12.0 * N));
    close_to("mean rz", mean[2], 2.5, 4 * 3 / sqrt(12.0 * N));
    close_to("mean turn", angle, 0.25, 4 * 0.5 / sqrt(12.0 * N));
    close_to("mean shift", shift, 1.5, 4 * 2 * 0.194 / sqrt((double)N));
    assert_true(widest > 0.49);
    sdm_phantom_random_params(ellipsoid, 5, p);
    sdm_phantom_random_params(ellipsoid, 5, again);
    assert_memory_equal(p, again, sizeof p);
    const sdm_pose none = sdm_phantom_random_pose(0, 0, 3);
    for (int i = 0; i < 3; i++) assert_true(none.rotation[i] == 0 && none.translation[i] == 0);
}

static void first_is_normal(const void *self, sdm_distribution *out)
{
    (void)self;
    out[0] = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 2, 0.3};
}

// A normal parameter has the mean and the deviation of its distribution; the others keep their
// values.
static void test_random_truth_may_be_normal(void **state)
{
    (void)state;
    enum { N = 2000 };
    sdm_shape shape = *sdm_instance_shape(ellipsoid);
    sdm_instance *s = NULL;
    double p[3], uniform[3], mean = 0, square = 0;
    shape.distributions = first_is_normal;
    assert_int_equal(sdm_instance_create(&shape, NULL, 0, NULL, &s, NULL), SDM_OK);
    for (uint64_t seed = 0; seed < N; seed++) {
        sdm_phantom_random_params(s, seed, p);
        sdm_phantom_random_params(ellipsoid, seed, uniform);
        assert_true(p[1] == uniform[1] && p[2] == uniform[2] && p[0] >= 1 && p[0] <= 5);
        mean += p[0] / N, square += (p[0] - 2) * (p[0] - 2) / N;
    }
    close_to("mean", mean, 2, 4 * 0.3 / sqrt(N));
    close_to("deviation", sqrt(square), 0.3, 4 * 0.3 / sqrt(2.0 * N));
    sdm_instance_free(s);
}

static void phantom_refused(const sdm_phantom_opts *o, const char *word)
{
    const sdm_grid g = oblique(4, 5, 6);
    float v[120];
    sdm_error err = {0};
    assert_int_equal(sdm_phantom_make(ellipsoid, NULL, NULL, o, &g, v, NULL, &err), SDM_E_ARG);
    if (!strstr(err.text, word)) fail_msg("'%s' does not name '%s'", err.text, word);
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_grid g = oblique(4, 5, 6);
    float v[120];
    sdm_error err;
    assert_int_equal(sdm_phantom_make(NULL, NULL, NULL, NULL, &g, v, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_phantom_make(ellipsoid, NULL, NULL, NULL, NULL, v, NULL, &err), SDM_E_ARG);
    assert_int_equal(sdm_phantom_make(ellipsoid, NULL, NULL, NULL, &g, NULL, NULL, &err),
                     SDM_E_ARG);
    assert_int_equal(
        sdm_phantom_make(ellipsoid, (const double[3]){4, NAN, 2}, NULL, NULL, &g, v, NULL, &err),
        SDM_E_RANGE);
    const sdm_pose nowhere = {.translation = {0, NAN, 0}};
    assert_int_equal(sdm_phantom_make(ellipsoid, NULL, &nowhere, NULL, &g, v, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, "translation along y"));
    g.spacing[1] = NAN;
    assert_int_equal(sdm_phantom_make(ellipsoid, NULL, NULL, NULL, &g, v, NULL, &err), SDM_E_ARG);

    static const double bad[] = {NAN, INFINITY, -INFINITY, -1};
    for (size_t i = 0; i < 4; i++) {
        sdm_phantom_opts o;
        for (int a = 0; a < 3; a++)
            o = plain(), o.blur[a] = bad[i], phantom_refused(&o, "blur along");
        o = plain(), o.noise = bad[i], phantom_refused(&o, "noise");
        o = plain(), o.texture_mm = bad[i], phantom_refused(&o, "texture");
        o = plain(), o.outside.sd = bad[i], phantom_refused(&o, "outside");
        if (i < 3) o = plain(), o.inside.mean = bad[i], phantom_refused(&o, "inside");
        if (i < 3) o = plain(), o.air.mean = bad[i], phantom_refused(&o, "air");
        o = plain(), o.air_share = bad[i], phantom_refused(&o, "share of air");
        o = plain(), o.air_share = 0.5, o.air_mm = bad[i], phantom_refused(&o, "diameter");
        o = plain(), o.air_share = 0.5, o.air_mm = 1, o.air_clear_mm = bad[i],
        phantom_refused(&o, "clear");
    }
    sdm_phantom_opts o = plain();
    o.blur[1] = 64.1 * 0.2, phantom_refused(&o, "blur along y");
    o = plain(), o.air_share = 1.5, phantom_refused(&o, "share of air");
    o = plain(), o.air_share = 0.5, o.air_mm = 1e-9, phantom_refused(&o, "too small");
    o = plain(), o.air_share = 0.5, o.air_mm = 1e-3, phantom_refused(&o, "larger");
    o = plain(), o.supersampling = 0, phantom_refused(&o, "supersampling");
    o = plain(), o.supersampling = 17, phantom_refused(&o, "supersampling");
    o = plain(), o.n_threads = -1, phantom_refused(&o, "threads");
}

// Options with air, and one thread.
static sdm_phantom_opts options_with_air(void)
{
    sdm_phantom_opts o = sdm_phantom_defaults();
    o.air_share = 0.5;
    o.n_threads = 1;
    return o;
}

static sdm_status small_phantom(const sdm_phantom_opts *o, sdm_error *err)
{
    const sdm_grid g = oblique(4, 5, 6);
    float v[120];
    uint8_t label[120];
    return sdm_phantom_make(block, NULL, NULL, o, &g, v, label, err);
}

static void test_each_allocation_may_fail(void **state)
{
    (void)state;
    // Each failed allocation is an error without a leak (detected by the sanitizer build).
    const sdm_phantom_opts o = options_with_air();
    for (unsigned long n = 1;; n++) {
        sdm_alloc_fail_after(n);
        sdm_error err;
        const sdm_status s = small_phantom(&o, &err);
        sdm_alloc_fail_after(0);
        assert_true(n < 2000);
        if (!s) break;
        assert_int_equal(s, SDM_E_NOMEM);
    }
}

// Cancels the work after `left` calls.
static bool cancel_when_used_up(void *user)
{
    int *left = user;
    return (*left)-- <= 0;
}

static void test_cancelled_at_any_call(void **state)
{
    (void)state;
    sdm_phantom_opts o = options_with_air();
    o.cancelled = cancel_when_used_up;
    sdm_status s = SDM_E_CANCELLED;
    int asked = 0;
    for (; s; asked++) {
        sdm_error err;
        int left = asked;
        o.user = &left;
        s = small_phantom(&o, &err);
        assert_true(asked < 10000 && (!s || s == SDM_E_CANCELLED));
    }
    // The hook is called for each row of both fields and for each plane of sub-voxels.
    assert_true(asked > 2 * 30 + 18);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_noise_has_its_statistics),
        cmocka_unit_test(test_random_truth_has_its_distribution),
        cmocka_unit_test(test_random_truth_may_be_normal),
        cmocka_unit_test(test_same_bits),
        cmocka_unit_test(test_each_allocation_may_fail),
        cmocka_unit_test(test_wrong_arguments_are_refused),
        cmocka_unit_test(test_cancelled_at_any_call),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
