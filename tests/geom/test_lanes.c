/* SIMD operations of simd/lanes.h with the baseline instruction set of the machine, compared lane
 * by lane with scalar arithmetic. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/rng.h"
#include "simd/lanes.h"

typedef struct group {
    _Alignas(64) float f[4][8];
    double d[4][4];
} group;

/* The kernels access the same memory as SIMD vectors and as single numbers. These functions mix
 * both: they fail if the compiler assumes that such accesses never overlap (strict aliasing). */
static __attribute__((noinline)) float store_between(group *x, float *row, int k, int lane)
{
    x->f[k][lane] = 1;
    v8_store(row, v8_all(2));
    return x->f[k][lane];
}

static __attribute__((noinline)) float load_between(group *x, const float *row, int k, int lane)
{
    _Alignas(32) float out[8];
    v8_store(out, v8_load(row));
    const float before = out[lane];
    x->f[k][lane] = 5;
    v8_store(out, v8_load(row));
    return out[lane] - before;
}

static __attribute__((noinline)) double store_doubles_between(group *x, double *row, int k,
                                                              int lane)
{
    x->d[k][lane] = 1;
    v4_store(row, v4_all(2));
    return x->d[k][lane];
}

static void test_vectors_and_numbers_share_memory(void **state)
{
    (void)state;
    group x = {0};
    assert_true(store_between(&x, x.f[1], 1, 3) == 2);
    x = (group){0};
    assert_true(load_between(&x, x.f[2], 2, 5) == 5);
    assert_true(store_doubles_between(&x, x.d[3], 3, 1) == 2);
}

static void random_lanes(uint64_t stream, float out[8])
{
    for (uint64_t i = 0; i < 8; i++) out[i] = (float)sdm_rng_normal(7, stream, i);
}

static void test_lane_operations(void **state)
{
    (void)state;
    for (uint64_t turn = 0; turn < 200; turn++) {
        _Alignas(32) float a[8], b[8], c[8], out[6][8];
        random_lanes(3 * turn, a);
        random_lanes(3 * turn + 1, b);
        random_lanes(3 * turn + 2, c);
        if (turn == 0) a[2] = b[2], a[3] = INFINITY, b[4] = -INFINITY;
        const v8f x = v8_load(a), y = v8_load(b), z = v8_load(c);
        uint32_t number[8], greater = 0;
        v8_store(out[0], v8_max(x, y));
        v8_store(out[1], v8_min(x, y));
        v8_store(out[2], v8_abs(x));
        v8_store(out[3], v8_rsqrt(v8_abs(z)));
        v8_store(out[4], v8_if_negative(z, x, y));
        v8_store(out[5], v8_sqrt(v8_abs(z)));
        v8_store_i(number, v8_if_less(x, y, v8_all_i(1), v8_all_i(-1)));
        for (int i = 0; i < 8; i++) {
            greater |= (uint32_t)(a[i] > b[i]) << i;
            assert_true(out[0][i] == fmaxf(a[i], b[i]) && out[1][i] == fminf(a[i], b[i]) &&
                        out[2][i] == fabsf(a[i]));
            assert_true(fabsf(out[3][i] * sqrtf(fabsf(c[i])) - 1) < 4e-4f);
            assert_true(out[4][i] == (signbit(c[i]) ? a[i] : b[i]) &&
                        out[5][i] == sqrtf(fabsf(c[i])));
            assert_true(number[i] == (a[i] < b[i] ? 1 : UINT32_MAX));
        }
        assert_int_equal(v8_greater(x, y), greater);
    }
}

static void test_permutation(void **state)
{
    (void)state;
    _Alignas(16) const uint16_t order[8] = {7, 0, 3, 3, 1, 6, 2, 5};
    const uint32_t from[8] = {10, 11, 12, 13, 14, 15, 16, UINT32_MAX};
    uint32_t out[8];
    v8_permute(out, v8_load_i(from), order);
    for (int i = 0; i < 8; i++) assert_true(out[i] == from[order[i]]);
}

static void test_four_doubles(void **state)
{
    (void)state;
    _Alignas(32) double a[4][4], out[4][4];
    v4d row[4];
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) a[i][j] = 4 * i + j;
    for (int i = 0; i < 4; i++) row[i] = v4_load(a[i]);
    v4_transpose(row);
    for (int i = 0; i < 4; i++) v4_store(out[i], row[i]);
    for (int i = 0; i < 4; i++)
        for (int j = 0; j < 4; j++) assert_true(out[i][j] == a[j][i]);
    _Alignas(32) const double mask[4] = {-1, 0, -1, 0};
    v4_store(out[0], v4_if_negative(v4_load(mask), v4_load(a[0]), v4_load(a[1])));
    for (int j = 0; j < 4; j++) assert_true(out[0][j] == a[mask[j] < 0 ? 0 : 1][j]);
}

static void test_roots_and_equal_lanes(void **state)
{
    (void)state;
    _Alignas(32) double x[4] = {2, 0.1, 0, 1e300}, root[4], size[4];
    v4_store(root, v4_sqrt(v4_load(x)));
    for (int i = 0; i < 4; i++) assert_true(root[i] == sqrt(x[i]));
    for (int i = 0; i < 4; i += 2) x[i] = -x[i];
    v4_store(size, v4_abs(v4_load(x)));
    for (int i = 0; i < 4; i++) assert_true(size[i] == fabs(x[i]) && !signbit(size[i]));
    uint32_t same[8];
    for (int i = 0; i < 8; i++) same[i] = 4000000000u;
    assert_true(v8_uniform(v8_load_i(same)));
    for (int i = 0; i < 8; i++) {
        same[i]++;
        assert_false(v8_uniform(v8_load_i(same)));
        same[i]--;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_vectors_and_numbers_share_memory),
        cmocka_unit_test(test_lane_operations), cmocka_unit_test(test_permutation),
        cmocka_unit_test(test_four_doubles), cmocka_unit_test(test_roots_and_equal_lanes)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
