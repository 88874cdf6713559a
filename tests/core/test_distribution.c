/* Distributions of parameters: quantiles against bisection in long double, moments against closed
 * forms, refused figures.
 * Tests: distribution.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/distribution.h"

typedef struct normal_case {
    double mean, deviation, min, max;
} normal_case;

// ranges about the mean, on one side of it, far from it, much wider and much narrower than the
// deviation
static const normal_case CASES[] = {
    {0, 1, -3, 3},
    {0, 1, -0.01, 0.01},
    {0, 1, -40, 40},
    {2, 0.5, 2, 9},
    {0, 1, 5, 5.5},
    {0, 1, -9, -5},
    {3, 1000, 2.5, 4},
    {0.145, 0.02, 0.05, 0.25},
    {-7, 2, -3, 100},
    {0, 1, 5.9, 1000},
    {1e6, 3, 1e6 - 9, 1e6 + 2},
};
enum { N_CASES = sizeof CASES / sizeof *CASES };

static long double tail(long double z) { return 0.5L * erfcl(z / sqrtl(2)); }

// Share of the probability of the range that lies below x, minus u. Differences are taken between
// tails that are small.
static long double excess(const normal_case *c, long double x, long double u)
{
    const long double mean = c->mean, sd = c->deviation, a = (c->min - mean) / sd,
                      b = (c->max - mean) / sd, z = (x - mean) / sd;
    const long double all = a > 0 ? tail(a) - tail(b) : tail(-b) - tail(-a);
    return z > 0 ? (1 - u) - (tail(z) - tail(b)) / all : (tail(-z) - tail(-a)) / all - u;
}

static long double bisect(const normal_case *c, long double u)
{
    long double low = c->min, high = c->max;
    for (int i = 0; i < 100; i++) {
        const long double middle = 0.5L * (low + high);
        *(excess(c, middle, u) < 0 ? &low : &high) = middle;
    }
    return 0.5L * (low + high);
}

static sdm_distribution normal_of(const normal_case *c)
{
    return (sdm_distribution){SDM_DISTRIBUTION_NORMAL, c->mean, c->deviation};
}

static void quantiles_match_bisection(void **state)
{
    (void)state;
    static const double EXTRA[] = {0x1p-33, 1e-6, 0.5 - 0x1p-33, 0.5, 0.5 + 0x1p-33, 1 - 0x1p-33};
    for (size_t i = 0; i < N_CASES; i++) {
        const normal_case *c = &CASES[i];
        const sdm_distribution d = normal_of(c);
        const double unit = fmin(c->deviation, c->max - c->min);
        double before = c->min;
        assert_int_equal(sdm_distribution_check(&d, c->min, c->max, NULL), SDM_OK);
        for (int k = 0; k < 200 + 6; k++) {
            const double u = k < 200 ? (k + 0.5) / 200 : EXTRA[k - 200];
            const double x = sdm_distribution_quantile(&d, c->min, c->max, u);
            const double wanted = (double)bisect(c, u);
            // a number near 1e6 cannot be stored more precisely than 2e-16 of it
            if (!(fabs(x - wanted) <= 1e-12 * unit + 2.3e-16 * fabs(wanted)))
                fail_msg("case %zu, u = %.17g: %.17g, wanted %.17g", i, u, x, wanted);
            assert_true(x >= c->min && x <= c->max);
            if (k < 200) assert_true(x >= before);
            before = x;
        }
        assert_true(sdm_distribution_quantile(&d, c->min, c->max, 0) == c->min);
        assert_true(sdm_distribution_quantile(&d, c->min, c->max, 1) == c->max);
    }
}

// The quantile of a uniform distribution is this formula, bit for bit: files of earlier versions
// depend on it.
static void uniform_is_linear(void **state)
{
    (void)state;
    const sdm_distribution d = {SDM_DISTRIBUTION_UNIFORM, 0, 0};
    const double min = 0.05, max = 0.25;
    for (int k = 0; k <= 1000; k++) {
        const double u = k / 1000.0, x = min + (max - min) * u;
        assert_true(sdm_distribution_quantile(&d, min, max, u) == x);
    }
}

static double density(double z) { return exp(-0.5 * z * z) / sqrt(2 * acos(-1)); }

// The mean and the variance of the quantiles of 2^16 equal steps of probability are those of the
// truncated normal distribution (Johnson, Kotz and Balakrishnan 1994).
static void moments_match_closed_forms(void **state)
{
    (void)state;
    enum { N = 1 << 16 };
    static const size_t USED[] = {0, 3, 4, 7};
    for (size_t i = 0; i < sizeof USED / sizeof *USED; i++) {
        const normal_case *c = &CASES[USED[i]];
        const sdm_distribution d = normal_of(c);
        double sum = 0, square = 0;
        for (int k = 0; k < N; k++) {
            const double x = sdm_distribution_quantile(&d, c->min, c->max, (k + 0.5) / N);
            sum += (x - c->mean) / N, square += (x - c->mean) * (x - c->mean) / N;
        }
        const double a = (c->min - c->mean) / c->deviation, b = (c->max - c->mean) / c->deviation;
        const double mass = (double)(tail(a) - tail(b)), first = (density(a) - density(b)) / mass;
        const double second = 1 + (a * density(a) - b * density(b)) / mass;
        assert_true(fabs(sum - c->deviation * first) < 1e-4 * c->deviation);
        assert_true(fabs(square / (c->deviation * c->deviation) - second) < 1e-3);
    }
}

static void refused(sdm_distribution d, double min, double max, const char *text)
{
    sdm_error err = {0};
    assert_int_equal(sdm_distribution_check(&d, min, max, &err), SDM_E_ARG);
    if (!strstr(err.text, text)) fail_msg("'%s' is not in '%s'", text, err.text);
}

static void bad_figures_are_refused(void **state)
{
    (void)state;
    const sdm_distribution_kind normal = SDM_DISTRIBUTION_NORMAL;
    refused((sdm_distribution){(sdm_distribution_kind)2, 0, 1}, 0, 1, "unknown kind 2");
    refused((sdm_distribution){normal, NAN, 1}, 0, 1, "the mean nan is not finite");
    refused((sdm_distribution){normal, INFINITY, 1}, 0, 1, "the mean inf is not finite");
    refused((sdm_distribution){normal, 0, 0}, 0, 1, "the deviation 0 is not a finite number above");
    refused((sdm_distribution){normal, 0, -1}, 0, 1, "the deviation -1 is not");
    refused((sdm_distribution){normal, 0, NAN}, 0, 1, "the deviation nan is not");
    refused((sdm_distribution){normal, 0, INFINITY}, 0, 1, "the deviation inf is not");
    refused((sdm_distribution){normal, 0, 1001}, 0, 1, "more than 1000 times the range 0 .. 1");
    // 6.1 and 5.9 deviations away
    refused((sdm_distribution){normal, 7.1, 1}, 0, 1, "has no values in the range 0 .. 1");
    refused((sdm_distribution){normal, -61, 10}, 0, 1000, "has no values in the range 0 .. 1000");
    const sdm_distribution near = {normal, 6.9, 1}, wide = {normal, 0, 1000};
    assert_int_equal(sdm_distribution_check(&near, 0, 1, NULL), SDM_OK);
    assert_int_equal(sdm_distribution_check(&wide, 0, 1, NULL), SDM_OK);
    // the figures of a uniform distribution are not used
    const sdm_distribution uniform = {SDM_DISTRIBUTION_UNIFORM, NAN, -1};
    assert_int_equal(sdm_distribution_check(&uniform, 0, 1, NULL), SDM_OK);
}

static void texts_name_kind_and_figures(void **state)
{
    (void)state;
    char buf[80];
    const sdm_distribution uniform = {SDM_DISTRIBUTION_UNIFORM, 3, 4},
                           normal = {SDM_DISTRIBUTION_NORMAL, -1.2345678901234568e-300,
                                     1.2345678901234568e-300};
    assert_string_equal(sdm_distribution_text(&uniform, buf), "uniform");
    assert_string_equal(sdm_distribution_text(&normal, buf),
                        "normal, mean -1.2345678901234568e-300, deviation 1.2345678901234568e-300");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(quantiles_match_bisection),   cmocka_unit_test(uniform_is_linear),
        cmocka_unit_test(moments_match_closed_forms),  cmocka_unit_test(bad_figures_are_refused),
        cmocka_unit_test(texts_name_kind_and_figures),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
