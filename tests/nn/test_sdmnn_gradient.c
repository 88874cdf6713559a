/* The gradient of the whole sdmnn network with drop-out against central differences. The network
 * has no kinks (SiLU), and the steps are too small to change which voxel of a pooling window is
 * largest.
 * Tests: sdmnn_training.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/rng.h"
#include "sdm/internal/sdmnn.h"
#include "sdm/memory.h"

enum { BATCH = 2, PARAMS = 2, VOXELS = 9 * 6 * 5 };

static const sdm_sdmnn_arch ARCH = {.n_params = PARAMS,
                                    .n = {9, 6, 5},
                                    .depth = 2,
                                    .channels = 3,
                                    .width = 5,
                                    .block = 2,
                                    .dropout = 0.3};

static double loss(void *user, size_t index, const float *values, float *dvalues)
{
    double s = 0;
    (void)user;
    for (size_t i = 0; i < VOXELS; i++) {
        const double e = (double)values[i] - sdm_rng_normal(3, index, i);
        s += e * e / VOXELS;
        dvalues[i] = (float)(2 * e / VOXELS);
    }
    return s;
}

static float *random_weights(const sdm_sdmnn_arch *a)
{
    float *w;
    const size_t n = sdm_sdmnn_count(a);
    assert_int_equal(SDM_ALLOC(&w, n, "w", NULL), SDM_OK);
    sdm_sdmnn_init(a, NULL, 1, 2, w);
    for (size_t i = 0; i < n; i++) w[i] += 0.05f * (float)sdm_rng_normal(3, 5, i);
    return w;
}

static const float X[BATCH * PARAMS] = {0.3f, -0.7f, 0.9f, 0.1f};

static void gradient_matches_differences(void **state)
{
    (void)state;
    sdm_sdmnn *net;
    float *w = random_weights(&ARCH), *g, *other;
    const size_t n = sdm_sdmnn_count(&ARCH);
    assert_int_equal(SDM_ALLOC(&g, n, "g", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&other, n, "g", NULL), SDM_OK);
    assert_int_equal(sdm_sdmnn_create(&ARCH, BATCH, NULL, &net, NULL), SDM_OK);
    sdm_sdmnn_set(net, w);
    const double at = sdm_sdmnn_gradient(net, BATCH, X, loss, NULL, 1, 2, 3, g, 1);
    double size = 0;
    for (size_t i = 0; i < n; i++) size = fmax(size, fabs((double)g[i]));
    for (size_t i = 0; i < n; i += i % 7 + 1) {
        const float keep = w[i], h = 2e-3f;
        double around[2];
        for (int k = 0; k < 2; k++) {
            w[i] = keep + (k ? h : -h);
            sdm_sdmnn_set(net, w);
            around[k] = sdm_sdmnn_gradient(net, BATCH, X, loss, NULL, 1, 2, 3, other, 1);
        }
        w[i] = keep;
        assert_true(fabs((around[1] - around[0]) / (2 * (double)h) - (double)g[i]) < 2e-3 * size);
    }
    // Any number of threads gives the same bits; other drop-out masks give another loss.
    sdm_sdmnn_set(net, w);
    for (int threads = 2; threads <= 3; threads++) {
        assert_true(sdm_sdmnn_gradient(net, BATCH, X, loss, NULL, 1, 2, 3, other, threads) == at);
        assert_memory_equal(g, other, n * sizeof *g);
    }
    assert_true(sdm_sdmnn_gradient(net, BATCH, X, loss, NULL, 1, 2, 4, other, 1) != at);
    sdm_sdmnn_free(net);
    sdm_free(w), sdm_free(g), sdm_free(other);
}

// Without drop-out the loss of a batch is the sum over its maps, each as in the forward pass.
static void batch_is_the_sum(void **state)
{
    (void)state;
    sdm_sdmnn_arch a = ARCH;
    a.dropout = 0, a.activation = 2;
    sdm_sdmnn *net;
    float *w = random_weights(&a), *g[3], values[VOXELS], unused[VOXELS];
    const size_t n = sdm_sdmnn_count(&a);
    for (int i = 0; i < 3; i++) assert_int_equal(SDM_ALLOC(&g[i], n, "g", NULL), SDM_OK);
    assert_int_equal(sdm_sdmnn_create(&a, BATCH, NULL, &net, NULL), SDM_OK);
    sdm_sdmnn_set(net, w);
    sdm_sdmnn_forward(net, X, values, 2);
    const double both = sdm_sdmnn_gradient(net, 2, X, loss, NULL, 1, 2, 0, g[0], 2);
    const double one = sdm_sdmnn_gradient(net, 1, X, loss, NULL, 1, 2, 0, g[1], 2);
    assert_true(one == loss(NULL, 0, values, unused));
    // The index passed to the loss counts within the batch, so the second map alone is compared
    // with the first target.
    const double two = sdm_sdmnn_gradient(net, 1, X + PARAMS, loss, NULL, 1, 2, 0, g[2], 2);
    assert_true(both != one + two);
    sdm_sdmnn_forward(net, X + PARAMS, values, 1);
    assert_true(fabs(both - one - loss(NULL, 1, values, unused)) < 1e-12 * both);
    sdm_sdmnn_free(net);
    sdm_free(w);
    for (int i = 0; i < 3; i++) sdm_free(g[i]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(gradient_matches_differences),
                                       cmocka_unit_test(batch_is_the_sum)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
