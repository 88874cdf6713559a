/* Morphological closing of label maps by a ball: against brute force, at the border of the grid,
 * and wrong arguments.
 * Tests: closing.c distance_transform.c envelope.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/fit.h"
#include "sdm/internal/rng.h"

enum { NX = 13, NY = 11, NZ = 9, COUNT = NX * NY * NZ, PAD = 3 };

static sdm_grid grid_of(double h)
{
    sdm_grid g = sdm_grid_centred((int64_t[3]){NX, NY, NZ}, h, (double[3]){0, 0, 0});
    g.spacing[1] = 1.25 * h, g.spacing[2] = 1.5 * h;
    return g;
}

// Whether the offset d (in voxels) is at most `radius` mm long.
static bool reaches(const sdm_grid *g, const int d[3], double radius)
{
    double square = 0;
    for (int a = 0; a < 3; a++) square += (g->spacing[a] * d[a]) * (g->spacing[a] * d[a]);
    return square <= radius * radius * (1 + 1e-6);
}

static float label_at(const float *v, const int at[3])
{
    const int n[3] = {NX, NY, NZ};
    for (int a = 0; a < 3; a++)
        if (at[a] < 0 || at[a] >= n[a]) return 0;
    return v[(at[2] * NY + at[1]) * NX + at[0]];
}

// Whether the ball around a voxel contains no labelled voxel; its centre may lie outside of the
// grid.
static bool is_free(const sdm_grid *g, const float *v, const int centre[3], double radius)
{
    for (int k = -PAD; k <= PAD; k++)
        for (int j = -PAD; j <= PAD; j++)
            for (int i = -PAD; i <= PAD; i++) {
                const int d[3] = {i, j, k}, at[3] = {centre[0] + i, centre[1] + j, centre[2] + k};
                if (label_at(v, at) > 0 && reaches(g, d, radius)) return false;
            }
    return true;
}

static bool is_reached(const sdm_grid *g, const float *v, const int at[3], double radius)
{
    for (int k = -PAD; k <= PAD; k++)
        for (int j = -PAD; j <= PAD; j++)
            for (int i = -PAD; i <= PAD; i++) {
                const int d[3] = {i, j, k}, centre[3] = {at[0] + i, at[1] + j, at[2] + k};
                if (reaches(g, d, radius) && is_free(g, v, centre, radius)) return true;
            }
    return false;
}

static void test_closing_matches_brute_force(void **state)
{
    (void)state;
    const sdm_grid g = grid_of(0.4);
    for (uint64_t seed = 0; seed < 3; seed++) {
        float v[COUNT], closed[COUNT];
        const double radius = 0.4 + 0.21 * (double)seed;
        for (size_t i = 0; i < COUNT; i++) v[i] = sdm_rng_uniform(5, seed, i) < 0.15 ? 1 : 0;
        memcpy(closed, v, sizeof v);
        assert_int_equal(sdm_fit_close_labels(&g, radius, 1 + (int)seed, closed, NULL), SDM_OK);
        size_t filled = 0, left = 0;
        for (int i = 0; i < COUNT; i++) {
            const int at[3] = {i % NX, i / NX % NY, i / NX / NY};
            const bool inside = v[i] > 0 || !is_reached(&g, v, at, radius);
            if ((closed[i] > 0) != inside) fail_msg("seed %d, voxel %d", (int)seed, i);
            filled += inside && !(v[i] > 0);
            left += !inside;
        }
        if (!(filled > 10 && left > 10))
            fail_msg("seed %d: %zu filled, %zu left", (int)seed, filled, left);
    }
}

// A slab near the border with a gap of one voxel in it: only the gap is filled.
static void test_border(void **state)
{
    (void)state;
    const sdm_grid g = grid_of(0.5);
    float v[COUNT], closed[COUNT];
    for (int i = 0; i < COUNT; i++) v[i] = i % NX >= 3 && i % NX != 6 && i % NX <= 10;
    memcpy(closed, v, sizeof v);
    assert_int_equal(sdm_fit_close_labels(&g, 1.2, 0, closed, NULL), SDM_OK);
    for (int i = 0; i < COUNT; i++)
        assert_true(closed[i] == (i % NX >= 3 && i % NX <= 10 ? 1 : v[i]));
    memset(v, 0, sizeof v);
    assert_int_equal(sdm_fit_close_labels(&g, 1.2, 0, v, NULL), SDM_OK);
    for (int i = 0; i < COUNT; i++) assert_true(v[i] == 0);
}

static void test_wrong_arguments_are_refused(void **state)
{
    (void)state;
    sdm_grid g = grid_of(0.5);
    float v[COUNT] = {0};
    sdm_error err = {0};
    const double bad[] = {0, -1, NAN, INFINITY, 1e9};
    for (size_t i = 0; i < sizeof bad / sizeof *bad; i++) {
        assert_int_equal(sdm_fit_close_labels(&g, bad[i], 0, v, &err), SDM_E_ARG);
        assert_non_null(strstr(err.text, "closing by a ball of"));
    }
    assert_int_equal(sdm_fit_close_labels(NULL, 1, 0, v, &err), SDM_E_ARG);
    assert_int_equal(sdm_fit_close_labels(&g, 1, 0, NULL, &err), SDM_E_ARG);
    g.spacing[0] = 0;
    assert_int_equal(sdm_fit_close_labels(&g, 1, 0, v, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "spacing"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_closing_matches_brute_force),
                                       cmocka_unit_test(test_border),
                                       cmocka_unit_test(test_wrong_arguments_are_refused)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
