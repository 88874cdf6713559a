/* Fields of models on grids and at points, against splines that are solved and evaluated in double
 * precision by other formulas; the same bits for all threads and processors.
 * Tests: field.c field_grid.c field_points.c generate_field.c spline.c spline_grid.c
 * spline_kernels_generic.c spline_kernels_avx2.c spline_kernels_avx512.c spline_native.c
 * spline_change.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/field_scene.h"
#include "sdm/internal/processor.h"

// ---- grids

static void test_own_grid_has_the_bits_of_the_map(void **state)
{
    const scene *s = *state;
    static float values[BALL_VOXELS], slopes[2 * BALL_VOXELS], plain[BALL_VOXELS];
    for (int t = 0; t < 2; t++) {
        const sdm_grid g = model_grid(t);
        const size_t n = sdm_grid_count(&g);
        sdm_result r;
        assert_false(sdm_generate_grid(s->model[t], params, NULL, &g, values, slopes, &r, NULL));
        assert_true(same(values, s->map[t], n) && same(slopes, s->jacobian[t], 2 * n));
        assert_true(r.source == SDM_SOURCE_NETWORK && r.error_mm == 0.0125);
        assert_false(sdm_generate(s->model[t], params, NULL, plain, NULL, NULL));
        assert_false(sdm_generate_grid(s->model[t], params, NULL, &g, values, NULL, NULL, NULL));
        assert_true(same(values, plain, n));
    }
}

static void test_grids_agree_with_the_oracle(void **state)
{
    const scene *s = *state;
    for (int t = 0; t < 2; t++)
        for (int c = 0; c < N_CASES; c++) {
            const sdm_grid m = model_grid(t), g = case_grid(&m, &cases[c]);
            const size_t n = sdm_grid_count(&g);
            float *values = malloc(3 * n * sizeof *values), *slopes = values + n;
            sdm_error err;
            if (sdm_generate_grid(s->model[t], params, NULL, &g, values, slopes, NULL, &err))
                fail_msg("case %d: %s", c, err.text);
            for (uint64_t i = 0; i < 300; i++) {
                const size_t v = (size_t)(uniform(i) * (double)n);
                double x[3];
                sdm_grid_world(&g,
                               (const double[]){(double)(v % (size_t)g.n[0]),
                                                (double)(v / (size_t)g.n[0] % (size_t)g.n[1]),
                                                (double)(v / (size_t)(g.n[0] * g.n[1]))},
                               x);
                assert_true(fabs((double)values[v] - oracle_at(&s->value[t], x, NULL)) < 2e-6);
                for (size_t p = 0; p < 2; p++)
                    assert_true(fabs((double)slopes[p * n + v] -
                                     oracle_at(&s->slope[t][p], x, NULL)) < 2e-6);
            }
            free(values);
        }
}

/* Maps with one, two and three voxels along an axis. */
static void test_thin_maps(void **state)
{
    (void)state;
    static oracle o;
    static float map[BALL_VOXELS];
    for (int64_t thin = 1; thin <= 3; thin++)
        for (int a = 0; a < 3; a++) {
            int64_t n[3] = {9, 8, 7};
            n[a] = thin;
            const sdm_grid g = grid_of(n, (const double[]){0.25, 0.31, 0.28}, 0);
            sdm_model *m = ball_model("bulge", &g, ripple);
            assert_false(sdm_generate(m, params, NULL, map, NULL, NULL));
            oracle_fit(&g, map, &o);
            sdm_field *f = open_field(m, NULL, false);
            for (uint64_t i = 0; i < 50; i++) {
                double x[3], wanted[3];
                float value, gradient[3];
                random_point(&g, i, x);
                assert_false(sdm_field_point(f, x, &value, gradient, NULL, NULL));
                assert_true(fabs((double)value - oracle_at(&o, x, wanted)) < 2e-6);
                for (int b = 0; b < 3; b++)
                    assert_true(fabs((double)gradient[b] - wanted[b]) < 3e-5);
            }
            sdm_field_free(f);
            sdm_model_free(m);
        }
}

// ---- points

static void test_points_agree_with_the_oracle(void **state)
{
    const scene *s = *state;
    enum { N = 400 };
    static double x[N][3];
    static float values[N], gradient[N][3], slopes[N][2];
    for (int t = 0; t < 2; t++) {
        const sdm_grid g = model_grid(t);
        for (uint64_t i = 0; i < N; i++) random_point(&g, i, x[i]);
        sdm_error err;
        if (sdm_generate_points(s->model[t], params, NULL, x[0], N, values, gradient[0], slopes[0],
                                NULL, &err))
            fail_msg("%s", err.text);
        sdm_field *f = open_field(s->model[t], NULL, true);
        for (int i = 0; i < N; i++) {
            double wanted[3];
            float one, by_x[3], by_p[2];
            assert_true(fabs((double)values[i] - oracle_at(&s->value[t], x[i], wanted)) < 2e-6);
            for (int a = 0; a < 3; a++)
                assert_true(fabs((double)gradient[i][a] - wanted[a]) < 1e-5);
            for (int p = 0; p < 2; p++)
                assert_true(fabs((double)slopes[i][p] - oracle_at(&s->slope[t][p], x[i], NULL)) <
                            2e-6);
            assert_false(sdm_field_point(f, x[i], &one, by_x, by_p, NULL));
            assert_true(one == values[i] && same(by_x, gradient[i], 3) && same(by_p, slopes[i], 2));
        }
        sdm_field_free(f);
    }
}

static void test_points_have_the_bits_of_grids(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts bound = {.outside = SDM_OUTSIDE_BOUND};
    sdm_field *f = open_field(s->model[0], &bound, true);
    for (int c = 0; c < N_CASES; c++) {
        if (cases[c].order[0] != 0) continue; // the axes of the model in their order
        const sdm_grid m = model_grid(false);
        sdm_grid g = case_grid(&m, &cases[c]);
        for (int a = 0; a < 3; a++) g.origin[a] -= c == 2 ? 0.4 : 0; // leaves the box
        const size_t n = sdm_grid_count(&g);
        float *values = malloc(6 * n * sizeof *values), *slopes = values + n,
              *point = slopes + 2 * n, *by_params = point + n;
        double *x = malloc(3 * n * sizeof *x);
        for (size_t v = 0; v < n; v++)
            sdm_grid_world(&g,
                           (const double[]){(double)(v % (size_t)g.n[0]),
                                            (double)(v / (size_t)g.n[0] % (size_t)g.n[1]),
                                            (double)(v / (size_t)(g.n[0] * g.n[1]))},
                           x + 3 * v);
        assert_false(sdm_field_grid(f, &g, values, slopes, NULL));
        assert_false(sdm_field_points(f, x, n, point, NULL, by_params, NULL));
        assert_true(same(values, point, n));
        for (size_t v = 0; v < n; v++)
            assert_true(slopes[v] == by_params[2 * v] && slopes[n + v] == by_params[2 * v + 1]);
        free(x);
        free(values);
    }
    sdm_field_free(f);
}

// ---- threads and instruction sets

static void test_same_bits_for_threads_and_processors(void **state)
{
    const scene *s = *state;
    enum { N = 3000 };
    const sdm_grid m = model_grid(false), g = case_grid(&m, &cases[0]);
    const size_t n = sdm_grid_count(&g);
    float *first = malloc(n * sizeof *first), *values = malloc(n * sizeof *values);
    static double x[N][3];
    static float at[2][N], gradient[2][N][3];
    sdm_blocks bands[2] = {{.n_block = 0}};
    for (uint64_t i = 0; i < N; i++) random_point(&m, i, x[i]);
    for (int level = 0; level < SDM_PROCESSOR_LEVELS; level++)
        for (int threads = 1; threads <= 3; threads++) {
            if (sdm_processor_select(level) != level) continue;
            const bool other = level || threads > 1;
            const sdm_generate_opts o = {.n_threads = threads};
            sdm_field *f;
            assert_false(sdm_field_create(s->model[0], &o, false, &f, NULL));
            // the network, whose bits depend on the processor, uses one instruction set
            sdm_processor_select(-1);
            assert_false(sdm_field_set_params(f, params, NULL, NULL));
            sdm_processor_select(level);
            assert_false(sdm_field_grid(f, &g, other ? values : first, NULL, NULL));
            assert_false(sdm_field_points(f, x[0], N, at[other], gradient[other][0], NULL, NULL));
            assert_false(sdm_field_band(f, &g, 0.2, &bands[other], NULL));
            if (other) {
                assert_true(same(values, first, n) && same(at[0], at[1], N));
                assert_true(same(gradient[0][0], gradient[1][0], (size_t)3 * N));
                assert_int_equal(bands[0].n_block, bands[1].n_block);
                assert_memory_equal(bands[0].values, bands[1].values,
                                    bands[0].n_block * sizeof *bands[0].values);
                sdm_blocks_dispose(&bands[1]);
            }
            sdm_field_free(f);
        }
    sdm_processor_select(-1);
    sdm_blocks_dispose(&bands[0]);
    free(values);
    free(first);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_own_grid_has_the_bits_of_the_map),
        cmocka_unit_test(test_grids_agree_with_the_oracle),
        cmocka_unit_test(test_thin_maps),
        cmocka_unit_test(test_points_agree_with_the_oracle),
        cmocka_unit_test(test_points_have_the_bits_of_grids),
        cmocka_unit_test(test_same_bits_for_threads_and_processors),
    };
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
