/* Turned grids, whose rows are computed by vectors, against the same points one by one.
 * Tests: field_grid.c field_points.c spline_kernels_generic.c spline_kernels_avx2.c
 * spline_kernels_avx512.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/field_scene.h"
#include "sdm/internal/processor.h"

/* x[n][3] = the voxel centres of a grid. */
static void list_voxels(const sdm_grid *g, double *x)
{
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++, x += 3)
                sdm_grid_world(g, (const double[]){(double)i, (double)j, (double)k}, x);
}

/* Values and derivatives on a grid are those of the points, bit for bit, on every instruction
   set. */
static void expect_points(const sdm_field *f, const sdm_grid *g)
{
    const size_t n = sdm_grid_count(g);
    float *values = malloc(6 * n * sizeof *values), *slopes = values + n, *point = slopes + 2 * n,
          *by_params = point + n;
    double *x = malloc(3 * n * sizeof *x);
    list_voxels(g, x);
    assert_false(sdm_field_points(f, x, n, point, NULL, by_params, NULL));
    for (int level = 0; level < SDM_PROCESSOR_LEVELS; level++) {
        if (sdm_processor_select(level) != level) continue;
        assert_false(sdm_field_grid(f, g, values, slopes, NULL));
        assert_true(same(values, point, n));
        for (size_t v = 0; v < n; v++)
            assert_true(slopes[v] == by_params[2 * v] && slopes[n + v] == by_params[2 * v + 1]);
    }
    sdm_processor_select(-1);
    free(x);
    free(values);
}

/* A turned grid whose voxel (0, 0, 0) lies at a voxel of the map, with rows of `nx` voxels. */
static sdm_grid turned_grid(const sdm_grid *m, int64_t nx, double spacing)
{
    const double first[3] = {floor((double)m->n[0] / 2), floor((double)m->n[1] / 2),
                             floor((double)m->n[2] / 2)};
    return inner_grid(m, (const int[]){0, 1, 2}, first,
                      (const double[]){spacing, 1.3 * spacing, -spacing},
                      (const int64_t[]){nx, 7, 5}, 0.3);
}

/* Rows inside of the box and rows that leave it; the kernels take 64 voxels at once. */
static void test_rows_have_the_bits_of_points(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts bound = {.outside = SDM_OUTSIDE_BOUND, .n_threads = 2};
    static const int64_t lengths[] = {1, 3, 63, 64, 65, 200};
    for (int t = 0; t < 2; t++) {
        const sdm_grid m = model_grid(t);
        sdm_field *f = open_field(s->model[t], &bound, true);
        for (size_t i = 0; i < sizeof lengths / sizeof *lengths; i++)
            for (int leaves = 0; leaves < 2; leaves++) {
                const sdm_grid g = turned_grid(&m, lengths[i], leaves ? 0.17 : 0.004);
                expect_points(f, &g);
            }
        sdm_field_free(f);
    }
}

/* Maps with one, two and three voxels along an axis, which turned grids leave. */
static void test_thin_maps(void **state)
{
    (void)state;
    const sdm_generate_opts bound = {.outside = SDM_OUTSIDE_BOUND};
    for (int64_t thin = 1; thin <= 3; thin++)
        for (int a = 0; a < 3; a++) {
            int64_t n[3] = {9, 8, 7};
            n[a] = thin;
            const sdm_grid m = grid_of(n, (const double[]){0.25, 0.31, 0.28}, 0),
                           g = turned_grid(&m, 70, 0.02);
            sdm_model *model = ball_model("bulge", &m, ripple);
            sdm_field *f = open_field(model, &bound, true);
            expect_points(f, &g);
            sdm_field_free(f);
            sdm_model_free(model);
        }
}

/* A grid turned about the x axis of the map: the voxels of its first row are voxels of the map. */
static void test_voxels_of_the_map(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts bound = {.outside = SDM_OUTSIDE_BOUND};
    sdm_field *f = open_field(s->model[0], &bound, true);
    const sdm_grid m = model_grid(false);
    sdm_grid g = {.n = {17, 4, 4},
                  .spacing = {m.spacing[0], 0.05, 0.05},
                  .dir = {1, 0, 0, 0, 0.6, -0.8, 0, 0.8, 0.6}};
    sdm_grid_world(&m, (const double[]){0, 5, 6}, g.origin);
    float *values = malloc(sdm_grid_count(&g) * sizeof *values);
    assert_false(sdm_field_grid(f, &g, values, NULL, NULL));
    assert_true(same(values, s->map[0] + (6 * m.n[1] + 5) * m.n[0], 17));
    expect_points(f, &g);
    free(values);
    sdm_field_free(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rows_have_the_bits_of_points),
        cmocka_unit_test(test_thin_maps),
        cmocka_unit_test(test_voxels_of_the_map),
    };
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
