/* Convolution by oneDNN agrees with the library's own kernels and gives the same bits for any
 * number of threads.
 * Tests: conv_kernels_dnnl.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "feature_maps.h"
#include "sdmnn/conv.h"

static double largest_difference(const maps *a, const maps *b)
{
    double worst = 0;
    for (size_t i = 0; i < a->channels * maps_voxels(a); i++) {
        const size_t c = i / maps_voxels(a), v = i % maps_voxels(a);
        worst = fmax(worst, fabs((double)*maps_voxel(a, c, v) - (double)*maps_voxel(b, c, v)));
    }
    return worst;
}

static void same_as_native(void **state)
{
    (void)state;
    static const size_t grids[][3] = {{30, 25, 25}, {15, 13, 13}, {8, 7, 7}, {4, 4, 4}, {33, 1, 2}};
    static const sdm_conv convs[] = {
        {16, 32, 27}, {32, 16, 27}, {64, 32, 27}, {5, 16, 27}, {16, 16, 1}};
    const sdm_conv_backend *const one = sdm_conv_native(), *const two = sdm_conv_dnnl();
    assert_string_equal(two->name, "onednn");
    int differ = 0;
    for (size_t q = 0; q < 25; q++) {
        const sdm_fmap g = sdm_fmap_layout(grids[q / 5]);
        const sdm_conv c = convs[q % 5];
        float *w = floats_random(c.in * c.out * c.taps, 2), *bias = floats_random(c.out, 3);
        for (int transposed = 0; transposed < 2; transposed++) {
            const sdm_conv to = transposed ? sdm_conv_opposite(c) : c;
            maps x = maps_random(&g, to.in, 1), a = maps_new(&g, to.out), b = maps_new(&g, to.out);
            float *p = floats_random(one->packed_count(to), 1),
                  *r = floats_random(two->packed_count(to), 1);
            const sdm_conv_finish finish = {transposed ? NULL : bias, transposed ? -1 : 0, NULL};
            one->pack(c, transposed, w, p);
            two->pack(c, transposed, w, r);
            one->apply(&g, to, p, x.at, finish, a.at, 2);
            for (int threads = 1; threads <= 3; threads++) {
                maps more = maps_new(&g, to.out);
                two->apply(&g, to, r, x.at, finish, more.at, threads);
                if (threads == 1) memcpy(b.memory, more.memory, maps_bytes(&b));
                assert_memory_equal(b.memory, more.memory, maps_bytes(&b));
                maps_free(&more);
            }
            maps_check_zeros(&b);
            assert_true(largest_difference(&a, &b) < 2e-6 * sqrt((double)(to.in * to.taps)));
            differ += memcmp(a.memory, b.memory, maps_bytes(&a)) != 0;
            maps_free(&x), maps_free(&a), maps_free(&b);
            sdm_free(p), sdm_free(r);
        }
        sdm_free(w), sdm_free(bias);
    }
    assert_true(differ > 0); // oneDNN really ran: it rounds differently from the native kernels
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(same_as_native)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
