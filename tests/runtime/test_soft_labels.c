/* Softened labels: the same mean and the width of the Gaussian; NaN; fits to them on coarse maps.
 * Tests: soft_labels.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "fit/data/soft_labels.h"

enum { N = 40 };

static float labels[N * N * N], soft[N * N * N];

static sdm_grid grid_of(double spacing)
{
    return sdm_grid_centred((const int64_t[3]){N, N, N}, spacing, (const double[3]){0, 0, 0});
}

static size_t at(int i, int j, int k) { return (size_t)((k * N + j) * N + i); }

static void soften(double spacing, double sd, int threads)
{
    const sdm_grid g = grid_of(spacing);
    sdm_error err = {0};
    if (sdm_fit_soften_labels(&g, labels, sd, threads, soft, &err)) fail_msg("%s", err.text);
}

// A slab: the softened step is that of a Gaussian, 1 - Phi, as if it had the width of sd and of a
// voxel's sampling; the sum stays.
static void test_step(void **state)
{
    (void)state;
    for (size_t i = 0; i < N * N * N; i++) labels[i] = i % N >= 15 && i % N < 27;
    soften(0.5, 1.5, 2);
    double sum = 0;
    for (int i = 0; i < N; i++) {
        const double low = (15 - 0.5 - i) * 0.5 / 1.5, high = (27 - 0.5 - i) * 0.5 / 1.5;
        const double wanted = 0.5 * (erf(high * sqrt(0.5)) - erf(low * sqrt(0.5)));
        const double found = (double)soft[at(i, 20, 20)];
        if (fabs(found - wanted) > 0.01) fail_msg("%d: %g, wanted %g", i, found, wanted);
        sum += found;
    }
    assert_true(fabs(sum - 12) < 1e-4);
    // threads and no width
    static float one[N * N * N];
    memcpy(one, soft, sizeof one);
    soften(0.5, 1.5, 1);
    assert_memory_equal(one, soft, sizeof one);
    soften(0.5, 0, 1);
    assert_memory_equal(labels, soft, sizeof soft);
}

// Unknown voxels stay unknown and do not spread; a map without labels stays as it is.
static void test_unknown(void **state)
{
    (void)state;
    for (size_t i = 0; i < N * N * N; i++) labels[i] = i % N >= 10 ? 1 : 0;
    labels[at(30, 20, 20)] = NAN;
    soften(1, 1, 1);
    size_t unknown = 0;
    for (size_t i = 0; i < N * N * N; i++) {
        if (isnan(soft[i])) unknown++;
        if (i % N > 20 && !isnan(soft[i])) assert_true(fabsf(soft[i] - 1) < 1e-6f);
    }
    assert_true(unknown == 1 && isnan(soft[at(30, 20, 20)]));
    memset(labels, 0, sizeof labels);
    soften(1, 1, 1);
    assert_memory_equal(labels, soft, sizeof soft);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_step),
        cmocka_unit_test(test_unknown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
