/* A narrow band that is made block by block from a map gives the map back, cut off at the band.
 * Tests: band.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "sdm/band.h"
#include "sdm/memory.h"

enum { NX = 21, NY = 16, NZ = 9 }; // three, two and two blocks

/* The distance to a plane, mm: it crosses the grid, whose far blocks lie on both sides. */
static float distance(int64_t i, int64_t j, int64_t k)
{
    return (float)(0.8 * ((double)i - 10) + 0.6 * ((double)j - 7) + 1e-3 * (double)k);
}

/* A block of the band, in which all voxels have values. */
static void fill(float *to, const int64_t at[3])
{
    for (int64_t k = 0; k < 8; k++)
        for (int64_t j = 0; j < 8; j++)
            for (int64_t i = 0; i < 8; i++)
                *to++ = distance(8 * at[0] + i, 8 * at[1] + j, 8 * at[2] + k);
}

static void test_map(void **state)
{
    (void)state;
    sdm_band b = {.grid = {.n = {NX, NY, NZ}}, .width = 2, .blocks = {3, 2, 2}};
    assert_false(SDM_ALLOC(&b.block, 12, "blocks", NULL));
    assert_false(SDM_ALLOC(&b.values, (size_t)12 * SDM_BAND_VOXELS, "values", NULL));
    int64_t sides[2] = {0, 0};
    for (int32_t i = 0; i < 12; i++) {
        float *to = b.values + b.n * SDM_BAND_VOXELS, low = INFINITY, high = -INFINITY;
        fill(to, (const int64_t[]){i % 3, i / 3 % 2, i / 6});
        for (size_t v = 0; v < SDM_BAND_VOXELS; v++) {
            low = fminf(low, to[v]);
            high = fmaxf(high, to[v]);
        }
        const int32_t far = low >= 2 ? SDM_BAND_OUTSIDE : high <= -2 ? SDM_BAND_INSIDE : 0;
        b.block[i] = far ? far : (int32_t)b.n++;
        if (far) sides[far == SDM_BAND_INSIDE]++;
    }
    assert_true(sides[0] > 0 && sides[1] > 0 && b.n > 0);
    float map[NX * NY * NZ];
    sdm_band_map(&b, map);
    const float *at = map;
    for (int64_t k = 0; k < NZ; k++)
        for (int64_t j = 0; j < NY; j++)
            for (int64_t i = 0; i < NX; i++)
                assert_true(*at++ == fmaxf(-2, fminf(distance(i, j, k), 2)));
    sdm_band_dispose(&b);
    assert_null(b.block);
    assert_null(b.values);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_map)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
