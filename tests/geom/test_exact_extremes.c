/* Maps of extreme grids (very far from the surface, thin, huge or tiny) and narrow bands, compared
 * with brute force.
 * Tests: boundary.c grid_distance.c row_base.c */
#include <float.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "oracle/exact_meshes.h"
#include "sdm/exact.h"
#include "sdm/internal/brute_force.h"
#include "sdm/internal/processor.h"

static sdm_grid grid_of(int64_t nx, int64_t ny, int64_t nz, double spacing, double x, double y,
                        double z)
{
    return (sdm_grid){.n = {nx, ny, nz},
                      .origin = {x, y, z},
                      .spacing = {spacing, spacing, spacing},
                      .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
}

/* Compares a map with brute force for every instruction set. band_mm > 0: values are limited to
 * +-band_mm and voxels outside of the band have no nearest triangle; 0: no limit. */
static void compare_with_brute_force(const sdm_mesh *m, sdm_grid g, double band_mm)
{
    const size_t n = sdm_grid_count(&g);
    float *values = malloc(n * sizeof *values);
    uint32_t *triangle = malloc(n * sizeof *triangle);
    double *truth = malloc(n * sizeof *truth), *rounding = malloc(n * sizeof *rounding);
    assert_true(values && triangle && truth && rounding);
    double largest = 1e-300;
    for (size_t i = 0; i < 3 * m->n_vert; i++) largest = fmax(largest, fabs(m->vert[i]));
    for (size_t i = 0; i < n; i++) {
        const size_t nx = (size_t)g.n[0], ny = (size_t)g.n[1];
        const double index[3] = {(double)(i % nx), (double)(i / nx % ny), (double)(i / nx / ny)};
        double x[3];
        sdm_grid_world(&g, index, x);
        truth[i] = fabs(sdm_naive_point(m, x));
        rounding[i] = largest;
        for (int a = 0; a < 3; a++) rounding[i] = fmax(rounding[i], fabs(x[a]));
        rounding[i] = 32 * DBL_EPSILON * rounding[i] + 1e-7 * truth[i];
    }
    for (int level = 0; level <= sdm_processor_select(-1); level++) {
        sdm_error err = {0};
        sdm_exact *e;
        assert_int_equal(sdm_processor_select(level), level);
        assert_int_equal(sdm_exact_create(m, &(sdm_exact_opts){.keep_overlap = true}, &e, &err),
                         SDM_OK);
        const sdm_exact_layers layers = {
            .values = values, .triangle = triangle, .band_mm = band_mm};
        if (sdm_exact_map_layers(e, &g, &layers, &err)) fail_msg("%s", err.text);
        for (size_t i = 0; i < n; i++) {
            double d = truth[i];
            if (band_mm > 0 && d >= band_mm) {
                if (d - band_mm > rounding[i]) assert_true(triangle[i] == UINT32_MAX);
                d = band_mm;
            } else if (band_mm > 0 && band_mm - d > rounding[i]) {
                assert_true(triangle[i] < sdm_exact_surface(e)->n_tri);
            }
            if (!(fabs(fabs((double)values[i]) - d) <= rounding[i]))
                fail_msg("level %d, voxel %zu: %.9g, brute force %.9g", level, i, (double)values[i],
                         d);
        }
        sdm_exact_free(e);
    }
    (void)sdm_processor_select(-1);
    free(values);
    free(truth);
    free(rounding);
    free(triangle);
}

static void mesh_right_triangle(sdm_mesh *m, double size)
{
    mesh_make(m, 3, 1);
    mesh_vertex(m, 0, 0, 0, 0);
    mesh_vertex(m, 1, size, 0, 0);
    mesh_vertex(m, 2, 0, size, 0);
    mesh_triangle(m, 0, 0, 1, 2);
}

static void test_narrow_bands(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 10);
    // a band much wider than a voxel: the culling limit must include rounding errors in proportion
    // to the band
    compare_with_brute_force(&m, grid_of(40, 40, 40, 0.05, 2.0641, 2.0641, 2.0641), 5);
    compare_with_brute_force(&m, grid_of(30, 30, 30, 0.1, -1.5, -1.5, -1.5), 0.25);
    compare_with_brute_force(&m, grid_of(30, 30, 30, 0.1, -1.5, -1.5, -1.5), 1e-6);
    compare_with_brute_force(&m, grid_of(20, 20, 20, 0.1, 50, 0, 0), 3);
    sdm_mesh_dispose(&m);
    float value;
    sdm_exact *e;
    mesh_right_triangle(&m, 1);
    assert_int_equal(sdm_exact_create(&m, NULL, &e, NULL), SDM_OK);
    const sdm_grid g = grid_of(1, 1, 1, 1, 0, 0, 0);
    const double wrong[2] = {-1, NAN};
    for (int i = 0; i < 2; i++)
        assert_int_equal(
            sdm_exact_map_layers(e, &g, &(sdm_exact_layers){.values = &value, .band_mm = wrong[i]},
                                 NULL),
            SDM_E_ARG);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

static void test_far_away(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_sphere(&m, (const double[3]){0, 0, 0}, 1, 6);
    // two needles so narrow that single precision cannot separate their edges
    const size_t v = m.n_vert, t = m.n_tri;
    mesh_make(&m, v + 6, t + 2);
    for (size_t i = 0; i < 2; i++) {
        mesh_vertex(&m, v + 3 * i, i ? 0 : 3, i ? 3 : 0, 0);
        mesh_vertex(&m, v + 3 * i + 1, i ? 0.5 : 3.5, i ? 3.001 : 0.001, 0);
        mesh_vertex(&m, v + 3 * i + 2, i ? 1 : 4, i ? 3 : 0, 0);
        mesh_triangle(&m, t + i, v + 3 * i, v + 3 * i + 1, v + 3 * i + 2);
    }
    const double far[5] = {1e2, 1e4, 4e4, 3e5, 1e9};
    for (int i = 0; i < 5; i++) {
        compare_with_brute_force(&m, grid_of(8, 8, 8, 0.5, 0, 0, far[i]), 0);
        compare_with_brute_force(&m, grid_of(8, 8, 8, 0.5, 0, 0, far[i]), far[i] + 1);
    }
    sdm_mesh_dispose(&m);
}

static void test_extreme_sizes(void **state)
{
    (void)state;
    sdm_mesh m = {0};
    mesh_right_triangle(&m, 1);
    // the spacing along an axis with a single voxel has no effect
    for (double spacing = 1; spacing <= 1e100; spacing *= 1e20) {
        compare_with_brute_force(&m, grid_of(1, 1, 1, spacing, 1.1, 0.2, 0.3), 0);
        sdm_grid slice = grid_of(1, 5, 5, 0.1, 1.1, 0.2, 0.3);
        slice.spacing[0] = spacing;
        compare_with_brute_force(&m, slice, 0);
    }
    const double spacing[5] = {1e-30, 1e-9, 1e4, 1e9, 1e30};
    for (int i = 0; i < 5; i++)
        compare_with_brute_force(&m, grid_of(5, 4, 3, spacing[i], 0, 0, 0), 0);
    sdm_mesh_dispose(&m);
    mesh_right_triangle(&m, 1e-17);
    compare_with_brute_force(&m, grid_of(9, 9, 9, 0.05, 0.3, 0.1, 0.2), 0);
    sdm_mesh_dispose(&m);
    // a triangle that is a point
    mesh_right_triangle(&m, 0);
    compare_with_brute_force(&m, grid_of(9, 9, 9, 1e-30, 1e-30, 0, 0), 0);
    compare_with_brute_force(&m, grid_of(9, 9, 9, 1e20, 0, 0, 0), 0);
    sdm_mesh_dispose(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_narrow_bands),
        cmocka_unit_test(test_far_away),
        cmocka_unit_test(test_extreme_sizes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
