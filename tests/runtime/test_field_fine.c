/* Fields of a model with a fine level: its own grid, the grid of the fine level, other grids,
 * points and bands against each other, derivatives against differences. Tests: field.c field_grid.c
 * field_points.c field_band.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/ball_model.h"
#include "sdm/field.h"
#include "sdm/internal/fine.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"

enum { WIDTH = 12, NX = 17, NY = 12, NZ = 14, N = NX * NY * NZ, FINE = 33 * 23 * 27 };

static const double params[2] = {1.31, 0.4};
static float weights[66 * WIDTH + (WIDTH + 1) * WIDTH + (WIDTH + 1) * 8];

/* Bends maps, so that the gates of cells are shut, half open and open. */
static double ripple(const double x[3]) { return 1 + 4 * sin(3 * x[0]) * cos(2 * x[1] + x[2]); }

static sdm_grid model_grid(void)
{
    return (sdm_grid){.n = {NX, NY, NZ},
                      .origin = {-2, -1.7, -1.8},
                      .spacing = {0.25, 0.31, 0.28},
                      .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

static int open_model(void **state)
{
    const sdm_grid g = model_grid();
    const sdm_fine f = {.width = WIDTH, .threshold = 0.15f, .weights = weights};
    uint8_t *plain, *bytes;
    size_t plain_size, size;
    sdm_model *m;
    for (size_t i = 0; i < sdm_fine_count(WIDTH); i++)
        weights[i] = (float)(0.4 * sdm_rng_normal(7, 1, i));
    ball_model_bytes("bulge", &g, ripple, &plain, &plain_size);
    if (sdm_fine_attach(plain, plain_size, &f, &bytes, &size, NULL) ||
        sdm_model_open_memory("file", bytes, size, &m, NULL))
        return -1;
    sdm_free(bytes);
    sdm_free(plain);
    *state = m;
    return 0;
}

static int close_model(void **state)
{
    sdm_model_free(*state);
    return 0;
}

static bool same(const float *a, const float *b, size_t n) { return !memcmp(a, b, n * sizeof *a); }

static void test_own_grid_and_half_spacing(void **state)
{
    const sdm_model *m = *state;
    const sdm_grid g = model_grid(), fine = sdm_fine_grid(&g);
    static float maps[3 * N], values[FINE], slopes[2 * FINE], wanted[3 * FINE], without[FINE];
    assert_false(sdm_generate_jacobian(m, params, NULL, maps, maps + N, NULL, NULL));
    assert_false(sdm_generate_grid(m, params, NULL, &g, values, slopes, NULL, NULL));
    assert_true(same(values, maps, N) && same(slopes, maps + N, (size_t)2 * N));
    assert_false(sdm_fine_map(sdm_model_fine(m), &g, 2, maps, 1, wanted, NULL));
    assert_false(sdm_fine_map(NULL, &g, 0, maps, 1, without, NULL));
    assert_false(same(wanted, without, FINE));
    for (int threads = 1; threads <= 3; threads++) {
        const sdm_generate_opts o = {.n_threads = threads};
        assert_false(sdm_generate_grid(m, params, &o, &fine, values, slopes, NULL, NULL));
        assert_true(same(values, wanted, FINE) && same(slopes, wanted + FINE, (size_t)2 * FINE));
    }
}

/* A grid that lies anywhere in the box. */
static sdm_grid other_grid(void)
{
    sdm_grid g = model_grid();
    for (int a = 0; a < 3; a++) {
        g.origin[a] += 0.17;
        g.spacing[a] = 0.09;
        g.n[a] = 33 - 2 * a;
    }
    return g;
}
enum { OTHER = 33 * 31 * 29 };

static void test_points_and_bands_agree_with_grids(void **state)
{
    const sdm_model *m = *state;
    const sdm_grid g = other_grid();
    static float values[OTHER], slopes[2 * OTHER], point[OTHER], gradient[OTHER][3], by[OTHER][2];
    static double x[OTHER][3];
    const float width = 0.27f;
    sdm_field *f;
    sdm_blocks b;
    for (int v = 0; v < OTHER; v++)
        sdm_grid_world(&g, (const double[]){v % 33, v / 33 % 31, v / 33 / 31}, x[v]);
    assert_false(sdm_field_create(m, NULL, true, &f, NULL));
    assert_false(sdm_field_set_params(f, params, NULL, NULL));
    assert_false(sdm_field_grid(f, &g, values, slopes, NULL));
    assert_false(sdm_field_points(f, x[0], OTHER, point, gradient[0], by[0], NULL));
    assert_true(same(values, point, OTHER));
    for (int v = 0; v < OTHER; v++)
        assert_true(slopes[v] == by[v][0] && slopes[OTHER + v] == by[v][1]);
    assert_false(sdm_field_band(f, &g, (double)width, &b, NULL));
    assert_true(b.n_block > 0);
    for (int v = 0; v < OTHER; v++) {
        const int64_t at[3] = {v % 33, v / 33 % 31, v / 33 / 31};
        const uint32_t tile = b.tile[(at[2] / 8 * b.n[1] + at[1] / 8) * b.n[0] + at[0] / 8];
        const float d = values[v];
        const float in_band = tile == SDM_TILE_INSIDE ? -width
                              : tile == SDM_TILE_OUTSIDE
                                  ? width
                                  : b.values[tile][(at[2] % 8 * 8 + at[1] % 8) * 8 + at[0] % 8];
        assert_true(in_band == (d >= width ? width : d <= -width ? -width : d));
    }
    sdm_blocks_dispose(&b);
    sdm_field_free(f);
}

static void test_derivatives_agree_with_differences(void **state)
{
    const sdm_model *m = *state;
    const sdm_grid g = other_grid();
    static float values[OTHER], slopes[2 * OTHER], after[2][OTHER];
    static const double step[2] = {1e-3, 1e-2};
    assert_false(sdm_generate_grid(m, params, NULL, &g, values, slopes, NULL, NULL));
    for (int p = 0; p < 2; p++) {
        double largest = 0, error = 0;
        for (int k = 0; k < 2; k++) {
            double at[2] = {params[0], params[1]};
            at[p] += k ? step[p] : -step[p];
            assert_false(sdm_generate_grid(m, at, NULL, &g, after[k], NULL, NULL, NULL));
        }
        for (int v = 0; v < OTHER; v++) {
            const double wanted = ((double)after[1][v] - after[0][v]) / (2 * step[p]);
            largest = fmax(largest, fabs(wanted));
            error = fmax(error, fabs((double)slopes[p * OTHER + v] - wanted));
        }
        assert_true(largest > 0.3 && error < 5e-3 * largest);
    }
    // by the coordinates
    sdm_field *f;
    assert_false(sdm_field_create(m, NULL, false, &f, NULL));
    assert_false(sdm_field_set_params(f, params, NULL, NULL));
    for (int i = 0; i < 200; i++) {
        double x[3];
        float value, gradient[3], end[2];
        for (int a = 0; a < 3; a++)
            x[a] = -1.2 + 2.4 * sdm_rng_uniform(9, 1, (uint64_t)(3 * i + a));
        assert_false(sdm_field_point(f, x, &value, gradient, NULL, NULL));
        for (int a = 0; a < 3; a++) {
            for (int k = 0; k < 2; k++) {
                double y[3] = {x[0], x[1], x[2]};
                y[a] += k ? 1e-3 : -1e-3;
                assert_false(sdm_field_point(f, y, &end[k], NULL, NULL, NULL));
            }
            assert_true(fabs((double)(end[1] - end[0]) / 2e-3 - (double)gradient[a]) < 5e-3);
        }
    }
    sdm_field_free(f);
}

static void test_each_allocation_may_fail(void **state)
{
    const sdm_model *m = *state;
    const sdm_grid g = other_grid();
    static float values[OTHER];
    sdm_status s = SDM_E_NOMEM;
    unsigned long n = 0;
    while (s == SDM_E_NOMEM && n < 200) {
        sdm_alloc_fail_after(++n);
        s = sdm_generate_grid(m, params, NULL, &g, values, NULL, NULL, NULL);
    }
    sdm_alloc_fail_after(0);
    assert_true(s == SDM_OK && n > 12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_own_grid_and_half_spacing),
                                       cmocka_unit_test(test_points_and_bands_agree_with_grids),
                                       cmocka_unit_test(test_derivatives_agree_with_differences),
                                       cmocka_unit_test(test_each_allocation_may_fail)};
    return cmocka_run_group_tests(tests, open_model, close_model);
}
