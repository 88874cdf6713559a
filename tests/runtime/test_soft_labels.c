/* Softened labels: the same mean and the width of the Gaussian; NaN; fits to them on coarse maps.
 * Tests: posterior.c soft_labels.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "fit/data/soft_labels.h"
#include "oracle/fit_tools.h"

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

/* Labels with voxels of 0.3 mm, and maps of a thin torus with voxels twice as large: the wide edge
 * of the maps must not make the tube thicker, and the deviations must cover the errors. */
static void test_labels_on_coarse_maps(void **state)
{
    (void)state;
    const double truth[2] = {3, 0.8};
    const sdm_pose pose = {{0.2, -0.3, 0}, {0.11, -0.07, 0.05}};
    const sdm_grid g = sdm_grid_centred((int64_t[3]){32, 32, 24}, 0.3, (double[3]){0.1, 0, 0.05});
    sdm_instance *torus = NULL;
    assert_int_equal(sdm_instance_create(sdm_registry_find(registry, "torus", NULL),
                                         &(sdm_named_text){"edge", "0.2"}, 1, NULL, &torus, NULL),
                     SDM_OK);
    const sdm_fit_source source = {
        .shape = torus,
        .grid = sdm_grid_centred((int64_t[3]){20, 20, 10}, 0.6, (double[3]){0, 0, 0})};
    float *v = calloc(sdm_grid_count(&g), sizeof *v);
    if (!v) abort();
    assert_int_equal(sdm_fit_map(&source, truth, &pose, &g, 1, v, NULL), SDM_OK);
    for (size_t i = 0; i < sdm_grid_count(&g); i++) v[i] = v[i] < 0;
    const sdm_fit_target t = {.kind = SDM_FIT_LABEL, .grid = g, .values = v};
    sdm_fit_opts o = sdm_fit_defaults();
    o.start_params = truth;
    o.start_pose = pose;
    o.eps = o.polish_eps = 1e-3;
    sdm_fit_result r;
    sdm_error err = {0};
    if (sdm_fit(&source, &t, &o, &r, &err)) fail_msg("%s", err.text);
    for (int k = 0; k < 2; k++) {
        const double error = r.params[k] - truth[k];
        if (!(fabs(error) < 0.02 && fabs(error) < 3 * r.sd[k] && r.sd[k] < 0.05))
            fail_msg("parameter %d: off by %g, deviation %g", k, error, r.sd[k]);
    }
    // 0.12 voxels of the labels and 0.03 voxels of the map
    assert_true(fabs(r.model_error_mm - sqrt(0.036 * 0.036 + 0.018 * 0.018)) < 1e-12);
    sdm_fit_dispose(&r);
    sdm_instance_free(torus);
    free(v);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_step),
        cmocka_unit_test(test_unknown),
        cmocka_unit_test(test_labels_on_coarse_maps),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
