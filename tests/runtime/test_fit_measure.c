/* Standard deviations of measures: against those of measures at random parameters that are drawn
 * with the covariance of a fit, and against closed forms.
 * Tests: fit_measure.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "oracle/shape_registry.h"
#include "sdm/fit.h"
#include "sdm/internal/rng.h"

#define PI 3.14159265358979323846
#define N_MAX 16

static sdm_error err;

static sdm_instance *shape_make(const char *name, const sdm_named_text *options, size_t n)
{
    sdm_instance *s = NULL;
    if (sdm_instance_create(sdm_registry_find(registry, name, NULL), options, n, NULL, &s, &err))
        fail_msg("%s", err.text);
    return s;
}

/* The parts of a fit's result that measures use. */
typedef struct fake {
    double p[N_MAX], prior[N_MAX], covariance[(N_MAX + 6) * (N_MAX + 6)];
    sdm_fit_result fit;
} fake;

/* covariance of the parameters = factor factor^T with factor[n][n]; the pose has a large one, which
 * must not count. */
static void fake_make(fake *f, size_t n, const double *p, const double *factor)
{
    const size_t size = n + 6;
    memset(f, 0, sizeof *f);
    memcpy(f->p, p, n * sizeof *p);
    for (size_t i = 0; i < size; i++)
        for (size_t j = 0; j < size; j++)
            for (size_t k = 0; k < n; k++)
                f->covariance[i * size + j] +=
                    i < n && j < n ? factor[i * n + k] * factor[j * n + k] : 100;
    for (size_t i = 0; i < n; i++) f->prior[i] = 1e3;
    f->fit = (sdm_fit_result){
        .n_params = n, .params = f->p, .covariance = f->covariance, .prior_sd = f->prior};
}

static sdm_measures measured(const sdm_instance *s, const fake *f, const double *depths, size_t n)
{
    sdm_measures m;
    if (sdm_fit_measure(s, &f->fit, depths, n, &m, &err)) fail_msg("%s", err.text);
    return m;
}

/* Draws parameters and measures them. Returns the largest relative difference of the spread from
 * the stated standard deviations. */
static double worst_spread(const sdm_instance *s, const fake *f, const double *factor,
                           const double *depths, size_t n_depths, int draws)
{
    static double sum[SDM_MEASURES_MAX], square[SDM_MEASURES_MAX];
    const sdm_measures m = measured(s, f, depths, n_depths);
    const size_t n = f->fit.n_params;
    memset(sum, 0, sizeof sum);
    memset(square, 0, sizeof square);
    for (int k = 0; k < draws; k++) {
        sdm_measures now;
        double p[N_MAX], normal[N_MAX];
        for (size_t i = 0; i < n; i++) normal[i] = sdm_rng_normal(7, 1, (uint64_t)k * N_MAX + i);
        for (size_t i = 0; i < n; i++) {
            p[i] = f->p[i];
            for (size_t j = 0; j < n; j++) p[i] += factor[i * n + j] * normal[j];
        }
        if (sdm_shape_measure(s, p, depths, n_depths, &now, &err)) fail_msg("%s", err.text);
        for (size_t i = 0; i < m.n; i++) {
            const double d = now.at[i].value - m.at[i].value;
            sum[i] += d, square[i] += d * d;
        }
    }
    double worst = 0;
    for (size_t i = 0; i < m.n; i++) {
        const double mean = sum[i] / draws, sd = sqrt(square[i] / draws - mean * mean);
        if (m.at[i].sd > 0)
            worst = fmax(worst, fabs(sd / m.at[i].sd - 1));
        else
            assert_true(fabs(sd) < 1e-12);
        assert_false(m.at[i].not_determined);
    }
    return worst;
}

/* All nine parameters of the cochlea, with correlations as in a fit: a goes with b, alpha with
 * phi. */
static void test_cochlea(void **state)
{
    (void)state;
    const sdm_named_text options[] = {{"edge", "1"}, {"start", "cubic"}, {"free", "anatomy"}};
    sdm_instance *s = shape_make("cochlea", options, 3);
    const double p[9] = {4.2, 0.6, 0.14, 0.2, 0.2, 0.3, 14.5, 1.5, 5.3}, depths[2] = {8, 22},
                 sd[9] = {0.03, 0.05, 0.002, 0.06, 0.002, 0.03, 0.1, 0.05, 0.06};
    double factor[81] = {0};
    for (int i = 0; i < 9; i++)
        for (int j = 0; j <= i; j++)
            factor[9 * i + j] = sd[i] * (i == j ? 0.8 : j == i - 2 ? 0.6 : 0.1);
    fake f;
    fake_make(&f, 9, p, factor);
    const double worst = worst_spread(s, &f, factor, depths, 2, 500);
    if (worst > 0.1) fail_msg("a standard deviation is off by %.0f %%", 100 * worst);
    sdm_instance_free(s);
}

/* A torus: volume 2 pi^2 R r^2; both parameters fully correlated. */
static void test_closed_form(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("torus", &(sdm_named_text){"edge", "0.1"}, 1);
    const double p[2] = {3, 1}, factor[4] = {0.02, 0, -0.01, 0};
    fake f;
    fake_make(&f, 2, p, factor);
    const sdm_measures m = measured(s, &f, NULL, 0);
    const double volume = 2 * PI * PI * (0.02 - 2 * 3 * 0.01), area = 4 * PI * PI * (0.02 - 0.03);
    assert_true(fabs(m.at[0].sd / fabs(volume) - 1) < 0.01);
    assert_true(fabs(m.at[1].sd / fabs(area) - 1) < 0.01);
    assert_true(fabs(m.at[2].sd / 0.02 - 1) < 0.01); // 2 (R + r)
    assert_true(fabs(m.at[4].sd / 0.02 - 1) < 0.01); // 2 r
    // at the ends of the ranges the differences are one-sided
    const double end[2] = {2, 1.5};
    fake_make(&f, 2, end, factor);
    const sdm_measures at_end = measured(s, &f, NULL, 0);
    assert_true(fabs(at_end.at[0].sd / (2 * PI * PI * fabs(1.5 * 1.5 * 0.02 - 2 * 2 * 1.5 * 0.01)) -
                     1) < 0.02);
    sdm_instance_free(s);
}

static void test_what_is_not_determined(void **state)
{
    (void)state;
    sdm_instance *s = shape_make("torus", &(sdm_named_text){"edge", "0.3"}, 1);
    // the major radius is as open as before, the minor one is known
    const double p[2] = {3, 1}, factor[4] = {0.57, 0, 0, 0.001};
    fake f;
    fake_make(&f, 2, p, factor);
    f.prior[0] = f.prior[1] = 0.6;
    sdm_measures m = measured(s, &f, NULL, 0);
    assert_false(m.at[0].not_determined); // the prior of the minor radius adds to that before
    assert_false(m.at[4].not_determined);
    f.prior[1] = 0.02;
    m = measured(s, &f, NULL, 0);
    assert_true(m.at[0].not_determined);
    assert_true(m.at[2].not_determined);
    assert_false(m.at[4].not_determined);
    // two open parameters whose combination is known: x = R + r
    const double opposed[4] = {0.57, 0, -0.57, 0.001};
    fake_make(&f, 2, p, opposed);
    f.prior[0] = f.prior[1] = 0.6;
    m = measured(s, &f, NULL, 0);
    assert_false(m.at[2].not_determined);
    assert_true(m.at[2].sd < 0.05);
    assert_true(m.at[4].not_determined);
    // parameters that were kept; a covariance that is unknown
    const double none[4] = {0};
    fake_make(&f, 2, p, none);
    m = measured(s, &f, NULL, 0);
    for (size_t i = 0; i < m.n; i++) assert_true(!(m.at[i].sd > 0) && !isnan(m.at[i].sd));
    for (size_t i = 0; i < 64; i++) f.covariance[i] = NAN;
    m = measured(s, &f, NULL, 0);
    for (size_t i = 0; i < m.n; i++) assert_true(isnan(m.at[i].sd) && m.at[i].value > 0);
    // arguments
    f.fit.n_params = 3;
    assert_int_equal(sdm_fit_measure(s, &f.fit, NULL, 0, &m, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "the shape has 2 parameters, the fit 3"));
    assert_int_equal(sdm_fit_measure(NULL, &f.fit, NULL, 0, &m, &err), SDM_E_ARG);
    assert_int_equal(sdm_fit_measure(s, NULL, NULL, 0, &m, &err), SDM_E_ARG);
    sdm_instance_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_cochlea),
                                       cmocka_unit_test(test_closed_form),
                                       cmocka_unit_test(test_what_is_not_determined)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
