/* The fine level of a model against its formulas in double precision, its derivatives against
 * differences, its section in a file.
 * Tests: fine.c fine_file.c fine_halve.c fine_kernels_generic.c fine_kernels_avx2.c
 * fine_kernels_avx512.c fine_native.c activation.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/ball_model.h"
#include "sdm/internal/container.h"
#include "sdm/internal/fine.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/rng.h"

enum { WIDTH = 8, NX = 11, NY = 9, NZ = 10, N = NX * NY * NZ };
enum { FX = 2 * NX - 1, FY = 2 * NY - 1, FZ = 2 * NZ - 1, FINE = FX * FY * FZ };

static float weights[(65 + 1) * WIDTH + (WIDTH + 1) * WIDTH + (WIDTH + 1) * 8];

static sdm_fine network(void)
{
    for (size_t i = 0; i < sdm_fine_count(WIDTH); i++)
        weights[i] = (float)(0.4 * sdm_rng_normal(7, 1, i));
    return (sdm_fine){.width = WIDTH, .threshold = 0.3f, .weights = weights};
}

static sdm_grid grid(void)
{
    return (sdm_grid){
        .n = {NX, NY, NZ}, .spacing = {0.3, 0.2, 0.25}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

/* A map with creases: the smallest distance to three points and a plane. `shift` moves a point. */
static void fill_map(double shift, float *map)
{
    const double at[3][3] = {{0.7 + shift, 0.5, 0.6}, {2.1, 1.2, 1.4}, {1.5, 0.2, 2.0}};
    for (int i = 0; i < N; i++) {
        const double x[3] = {0.3 * (i % NX), 0.2 * (i / NX % NY), 0.25 * (i / NX / NY)};
        double d = 0.8 - 0.3 * x[2];
        for (int p = 0; p < 3; p++) {
            double square = 0;
            for (int a = 0; a < 3; a++) square += (x[a] - at[p][a]) * (x[a] - at[p][a]);
            d = fmin(d, sqrt(square) - 0.3);
        }
        map[i] = (float)d;
    }
}

/* ---- halfway between the voxels */

static double quintic(double x)
{
    return 0.3 + x * (1 - x * (0.7 - x * (0.2 - x * (0.05 + 0.01 * x))));
}

static void test_polynomials_are_continued(void **state)
{
    (void)state;
    static const int64_t sizes[][3] = {{9, 6, 7}, {6, 1, 8}, {1, 7, 6}};
    for (int c = 0; c < 3; c++) {
        const int64_t *n = sizes[c];
        sdm_grid g = grid();
        memcpy(g.n, n, sizeof g.n);
        const sdm_grid f = sdm_fine_grid(&g);
        float map[600], fine[13 * 17 * 15];
        double largest = 0;
        for (int64_t i = 0; i < n[0] * n[1] * n[2]; i++)
            map[i] =
                (float)(quintic((double)(i % n[0]) / 4) * quintic((double)(i / n[0] % n[1]) / 4) *
                        quintic((double)(i / n[0] / n[1]) / 4));
        assert_false(sdm_fine_map(NULL, &g, 0, map, 2, fine, NULL));
        for (int64_t i = 0; i < (int64_t)sdm_grid_count(&f); i++) {
            const int64_t x = i % f.n[0], y = i / f.n[0] % f.n[1], z = i / f.n[0] / f.n[1];
            const double wanted =
                quintic((double)x / 8) * quintic((double)y / 8) * quintic((double)z / 8);
            largest = fmax(largest, fabs((double)fine[i] - wanted));
        }
        assert_true(largest < 2e-6);
    }
}

static void test_short_axes(void **state)
{
    (void)state;
    sdm_grid g = grid();
    const float map[2 * 3] = {1, 3, 2, 5, 7, 1};
    float fine[3 * 5];
    g.n[0] = 2, g.n[1] = 3, g.n[2] = 1;
    assert_false(sdm_fine_map(NULL, &g, 0, map, 1, fine, NULL));
    assert_true(fine[0] == 1 && fine[1] == 2 && fine[2] == 3);
    assert_true(fine[7] == 3.5f && fine[12] == 7 && fine[13] == 4 && fine[14] == 1);
    // between rows 0 and 1: the parabola through 1, 2, 7 at one half
    assert_true(fabsf(fine[3] - 1) < 1e-6f);
}

/* ---- the changes */

static double activation(double z) { return z / 2 * (1 + z / sqrt(1 + z * z)); }

/* The formulas of fine.h at a cell: change[8], mm. Returns the gate. */
static double oracle(const float *map, int cell, double change[8])
{
    const double h = 0.2, t = 0.3f;
    const int step[3] = {1, NX, NX * NY}, first = cell - NX * NY - NX - 1;
    double x[65], y[WIDTH], z[WIDTH], mean = 0, c = 0;
    for (int q = 0; q < 8; q++) {
        const int v = cell + q % 2 + q / 2 % 2 * NX + q / 4 * NX * NY;
        mean += (double)map[v] / 8;
        for (int a = 0; a < 3; a++) {
            const double s = (double)map[v - step[a]] + map[v + step[a]] - 2 * (double)map[v];
            c += s * s / (h * h);
        }
    }
    for (int i = 0; i < 64; i++)
        x[i] = ((double)map[first + i % 4 + i / 4 % 4 * NX + i / 16 * NX * NY] - mean) / h;
    x[64] = mean / sqrt(h * h + mean * mean);
    const float *w = weights;
    for (int o = 0; o < WIDTH; o++) {
        y[o] = w[65 * WIDTH + o];
        for (int i = 0; i < 65; i++) y[o] += w[i * WIDTH + o] * x[i];
        y[o] = activation(y[o]);
    }
    w += 66 * WIDTH;
    for (int o = 0; o < WIDTH; o++) {
        z[o] = w[WIDTH * WIDTH + o];
        for (int i = 0; i < WIDTH; i++) z[o] += w[i * WIDTH + o] * y[i];
        z[o] = activation(z[o]);
    }
    w += (WIDTH + 1) * WIDTH;
    const double s = fmin(fmax((c - t * t) / (3 * t * t), 0), 1), gate = s * s * (3 - 2 * s);
    for (int o = 0; o < 8; o++) {
        change[o] = w[WIDTH * 8 + o];
        for (int i = 0; i < WIDTH; i++) change[o] += w[i * 8 + o] * z[i];
        change[o] *= gate * h / 10;
    }
    return gate;
}

static void test_changes_agree_with_the_formulas(void **state)
{
    (void)state;
    const sdm_fine f = network();
    const sdm_grid g = grid();
    static float map[N], plain[FINE], fine[FINE];
    static double wanted[FINE];
    int open = 0, shut = 0;
    fill_map(0, map);
    assert_false(sdm_fine_map(NULL, &g, 0, map, 1, plain, NULL));
    assert_false(sdm_fine_map(&f, &g, 0, map, 1, fine, NULL));
    for (int i = 0; i < FINE; i++) wanted[i] = plain[i];
    for (int i = 0; i < N; i++) {
        const int x = i % NX, y = i / NX % NY, z = i / NX / NY;
        double change[8];
        if (x < 1 || x > NX - 3 || y < 1 || y > NY - 3 || z < 1 || z > NZ - 3) continue;
        const double gate = oracle(map, i, change);
        open += gate > 0.5, shut += gate == 0;
        for (int q = 1; q < 8; q++)
            wanted[((2 * z + q / 4) * FY + 2 * y + q / 2 % 2) * FX + 2 * x + q % 2] += change[q];
    }
    assert_true(open > 30 && shut > 30);
    double largest = 0, error = 0;
    for (int i = 0; i < FINE; i++) {
        largest = fmax(largest, fabs((double)fine[i] - plain[i]));
        error = fmax(error, fabs((double)fine[i] - wanted[i]));
    }
    assert_true(largest > 0.01 && error < 1e-6);
}

static void test_cells_and_inputs(void **state)
{
    (void)state;
    const sdm_fine f = network();
    const sdm_grid g = grid();
    static float map[N];
    uint32_t *cells;
    size_t n, open = 0;
    fill_map(0, map);
    assert_false(sdm_fine_cells(&g, f.threshold, map, &cells, &n, NULL));
    for (int i = 0; i < N; i++) {
        const int x = i % NX, y = i / NX % NY, z = i / NX / NY;
        double change[8];
        if (x < 1 || x > NX - 3 || y < 1 || y > NY - 3 || z < 1 || z > NZ - 3) continue;
        const double gate = oracle(map, i, change);
        if (gate < 1e-6) continue;
        assert_true(open < n && cells[open] == (uint32_t)i);
        float in[SDM_FINE_INPUTS], at;
        sdm_fine_inputs(&g, f.threshold, map, cells[open++], in, &at);
        assert_true(fabs((double)at - gate) < 1e-4);
        assert_true(fabs((double)(in[1] - in[0]) * 0.2 -
                         ((double)map[i - NX * NY - NX] - map[i - NX * NY - NX - 1])) < 1e-5);
    }
    assert_int_equal(open, n);
    sdm_free(cells);
}

static void test_derivatives_agree_with_differences(void **state)
{
    (void)state;
    const sdm_fine f = network();
    const sdm_grid g = grid();
    const double step = 3e-4;
    static float maps[2 * N], ends[2][N], fine[2 * FINE], after[2][FINE];
    double largest = 0, error = 0;
    // The maps at the two ends of the step: each voxel moves by its derivative, maps[N + i].
    fill_map(0, maps);
    for (int i = 0; i < N; i++) {
        maps[N + i] = (float)(0.3 * sdm_rng_normal(8, 1, (uint64_t)i));
        for (int k = 0; k < 2; k++)
            ends[k][i] = (float)(maps[i] + (k ? step : -step) * (double)maps[N + i]);
    }
    assert_false(sdm_fine_map(&f, &g, 1, maps, 1, fine, NULL));
    for (int k = 0; k < 2; k++) assert_false(sdm_fine_map(&f, &g, 0, ends[k], 1, after[k], NULL));
    for (int i = 0; i < FINE; i++) {
        const double wanted = ((double)after[1][i] - after[0][i]) / (2 * step);
        largest = fmax(largest, fabs(wanted));
        error = fmax(error, fabs((double)fine[FINE + i] - wanted));
    }
    assert_true(largest > 0.5 && error < 3e-3 * largest);
}

static void test_same_bits_for_threads_and_processors(void **state)
{
    (void)state;
    const sdm_fine f = network();
    const sdm_grid g = grid();
    static float maps[2 * N], first[2 * FINE], fine[2 * FINE];
    fill_map(0, maps);
    fill_map(0.1, maps + N);
    assert_false(sdm_fine_map(&f, &g, 1, maps, 1, first, NULL));
    for (int level = 0; level < SDM_PROCESSOR_LEVELS; level++)
        for (int threads = 1; threads <= 3; threads++) {
            if (sdm_processor_select(level) != level) continue;
            assert_false(sdm_fine_map(&f, &g, 1, maps, threads, fine, NULL));
            assert_memory_equal(fine, first, sizeof fine);
        }
    sdm_processor_select(-1);
}

/* ---- the file */

static sdm_model *open_bytes(const uint8_t *bytes, size_t size, sdm_error *err)
{
    sdm_model *m;
    return sdm_model_open_memory("file", bytes, size, &m, err) ? NULL : m;
}

static void test_section_of_the_file(void **state)
{
    (void)state;
    sdm_fine f = network();
    const sdm_grid g = grid();
    sdm_error err;
    uint8_t *plain, *with, *again;
    size_t plain_size, size, again_size;
    ball_model_bytes("bulge", &g, NULL, &plain, &plain_size);
    sdm_model *m = open_bytes(plain, plain_size, &err);
    assert_true(sdm_model_get_info(m)->fine_width == 0 && !sdm_model_fine(m));
    sdm_model_free(m);
    assert_false(sdm_fine_attach(plain, plain_size, &f, &with, &size, &err));
    m = open_bytes(with, size, &err);
    assert_int_equal(sdm_model_get_info(m)->fine_width, WIDTH);
    assert_true(sdm_model_fine(m)->threshold == f.threshold);
    assert_memory_equal(sdm_model_fine(m)->weights, weights, sizeof weights);
    sdm_model_free(m);
    // a second one takes the place of the first
    f.threshold = 0.5f;
    assert_false(sdm_fine_attach(with, size, &f, &again, &again_size, &err));
    assert_int_equal(again_size, size);
    m = open_bytes(again, again_size, &err);
    assert_true(sdm_model_fine(m)->threshold == 0.5f);
    sdm_model_free(m);
    sdm_free(again);
    sdm_free(with);
    sdm_free(plain);
}

/* *err = the error of opening a file whose section has `size` bytes. */
static void open_damaged(const uint8_t *plain, size_t plain_size, const void *data, size_t size,
                         sdm_error *err)
{
    sdm_section sections[SDM_CONTAINER_MAX_SECTIONS];
    char names[SDM_CONTAINER_MAX_SECTIONS][24];
    size_t n, bytes_size;
    uint64_t checksum;
    uint8_t *bytes;
    assert_false(sdm_container_parse(plain, plain_size, sections, names, &n, &checksum, NULL));
    sections[n] = (sdm_section){"fine", data, size};
    assert_false(sdm_container_build(sections, n + 1, &bytes, &bytes_size, NULL));
    assert_null(open_bytes(bytes, bytes_size, err));
    assert_int_equal(err->status, SDM_E_FORMAT);
    sdm_free(bytes);
}

static void test_damaged_sections_are_refused(void **state)
{
    (void)state;
    const sdm_grid g = grid();
    sdm_error err;
    uint8_t *plain;
    size_t plain_size;
    const size_t size = 16 + sizeof weights;
    union {
        uint32_t head[4];
        float values[4 + sizeof weights / sizeof(float)];
    } good = {.head = {WIDTH, 65, 8}}, bad;
    network();
    good.values[3] = 0.3f;
    memcpy(good.values + 4, weights, sizeof weights);
    ball_model_bytes("bulge", &g, NULL, &plain, &plain_size);
    open_damaged(plain, plain_size, &good, size - 4, &err);
    assert_non_null(strstr(err.text, "section fine"));
    open_damaged(plain, plain_size, &good, 8, &err);
    open_damaged(plain, plain_size, &good, 0, &err);
    static const uint32_t heads[][3] = {{6, 65, 8},     {0, 65, 8},    {WIDTH, 64, 8},
                                        {WIDTH, 65, 7}, {4096, 65, 8}, {UINT32_MAX, 65, 8}};
    for (size_t i = 0; i < sizeof heads / sizeof *heads; i++) {
        bad = good;
        memcpy(bad.head, heads[i], sizeof heads[i]);
        open_damaged(plain, plain_size, &bad, size, &err);
    }
    for (int i = 0; i < 3; i++) {
        bad = good;
        if (i == 0) bad.values[3] = 0;
        if (i == 1) bad.values[3] = NAN;
        if (i == 2) bad.values[44] = INFINITY;
        open_damaged(plain, plain_size, &bad, size, &err);
        assert_non_null(strstr(err.text, "not finite"));
    }
    sdm_free(plain);
}

static void test_each_allocation_may_fail(void **state)
{
    (void)state;
    const sdm_fine f = network();
    const sdm_grid g = grid();
    static float map[N], fine[FINE];
    sdm_status s = SDM_E_NOMEM;
    unsigned long n = 0;
    fill_map(0, map);
    while (s == SDM_E_NOMEM && n < 100) {
        sdm_alloc_fail_after(++n);
        s = sdm_fine_map(&f, &g, 0, map, 1, fine, NULL);
    }
    sdm_alloc_fail_after(0);
    assert_true(s == SDM_OK && n > 5);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_polynomials_are_continued),
                                       cmocka_unit_test(test_short_axes),
                                       cmocka_unit_test(test_changes_agree_with_the_formulas),
                                       cmocka_unit_test(test_cells_and_inputs),
                                       cmocka_unit_test(test_derivatives_agree_with_differences),
                                       cmocka_unit_test(test_same_bits_for_threads_and_processors),
                                       cmocka_unit_test(test_section_of_the_file),
                                       cmocka_unit_test(test_damaged_sections_are_refused),
                                       cmocka_unit_test(test_each_allocation_may_fail)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
