/* The forecast of a large exact map, and maps for which there is no memory.
 * Tests: map_memory.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "measure/map_memory.h"

static sdm_grid cube(int64_t n, double edge)
{
    const double spacing = edge / (double)(n - 1);
    const double centre[3] = {0, 0, 0};
    return sdm_grid_centred((int64_t[3]){n, n, n}, spacing, centre);
}

// A map of 1500 x 1500 x 1500 voxels, 13.5 GB, is told of a few of its planes.
static void tells_a_large_map(void **state)
{
    (void)state;
    double vert[12] = {0, 0, 0, 2, 0, 0, 0, 2, 0, 0, 0, 2};
    uint32_t tri[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    const sdm_mesh mesh = {.vert = vert, .tri = tri, .n_vert = 4, .n_tri = 4};
    const sdm_grid grid = cube(1500, 4);
    sdm_exact *engine = NULL;
    sdm_text text = {0};
    assert_int_equal(sdm_exact_create(&mesh, NULL, &engine, NULL), SDM_OK);
    assert_int_equal(cli_forecast_map(engine, &grid, 4, &text, NULL), SDM_OK);
    assert_non_null(
        strstr(text.data, "1500 x 1500 x 1500 = 3,375,000,000 voxels, 14 GB; it takes"));
    // 2e8 bytes are 67.5 times less: 4.07 times the spacing of 0.0026684 mm, with two digits
    assert_non_null(strstr(text.data, "; the same box with --spacing 0.011 needs 0.19 GB"));
    sdm_text_dispose(&text);
    // small maps are not told, and their planes not computed
    assert_int_equal(cli_tell_large_map(NULL, &(sdm_grid){.n = {9, 9, 9}}, 4, NULL), SDM_OK);
    sdm_exact_free(engine);
}

static void refuses_what_memory_does_not_hold(void **state)
{
    (void)state;
    const sdm_grid grid = cube(100001, 100);
    sdm_error err = {0};
    const double bytes = 4e15, left = cli_free_memory();
    if (!(left > 0)) skip();
    assert_int_equal(cli_check_map_memory(&grid, bytes, &err), SDM_E_NOMEM);
    assert_non_null(strstr(err.text, "voxels: it needs 4e+06 GB, and "));
    assert_non_null(strstr(err.text, "GB are free; a larger --spacing or a smaller --size"));
    assert_non_null(strstr(err.text, "; the same box with --spacing 0."));
    assert_int_equal(cli_check_map_memory(&grid, 0.5 * left, &err), SDM_OK);
    // axes of their own
    sdm_grid other = grid;
    other.spacing[1] = 0.002;
    assert_int_equal(cli_check_map_memory(&other, bytes, &err), SDM_E_NOMEM);
    const char *spacing = strstr(err.text, "--spacing 0.");
    assert_true(spacing && strchr(spacing, ',') < strstr(spacing, " needs "));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tells_a_large_map),
        cmocka_unit_test(refuses_what_memory_does_not_hold),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
