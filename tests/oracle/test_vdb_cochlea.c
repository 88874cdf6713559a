/* Level sets of real shapes: cochleas have creases, sheets and gaps thinner than a voxel, on which OpenVDB's checkLevelSet still wants a
   gradient. Every one must be written, pass the check, and stay close to the map it came from. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/memory.h"
#include "sdm/rng.h"
#include "sdm/runtime.h"
#include "sdm/vdb.h"

enum { SHAPES = 30 };

static void every_cochlea_becomes_a_level_set(void **state)
{
    (void)state;
    sdm_registry *r;
    sdm_instance *cochlea;
    sdm_error e = {0};
    const char *path = "cochlea_level_set.vdb";
    assert_int_equal(sdm_registry_create(&r, &e), SDM_OK);
    assert_int_equal(sdm_builtin_shapes_add(r, &e), SDM_OK);
    assert_int_equal(sdm_instance_create(sdm_registry_find(r, "cochlea", NULL), NULL, 0, NULL, &cochlea, &e), SDM_OK);
    const sdm_grid grid = sdm_grid_centred((const int64_t[]){60, 50, 50}, 0.2, (const double[]){0.5, 0.4, 1.2});
    float *values;
    assert_int_equal(SDM_ALLOC(&values, sdm_grid_count(&grid), "map", &e), SDM_OK);
    size_t n;
    const sdm_param *p = sdm_instance_params(cochlea, &n);
    for (uint64_t i = 0; i < SHAPES; i++) {
        double at[8];
        for (size_t k = 0; k < n; k++) at[k] = p[k].min + (p[k].max - p[k].min) * sdm_rng_uniform(7, i, k);
        if (sdm_exact_shape_map(cochlea, at, NULL, &grid, values, NULL, &e)) fail_msg("%s", e.text);
        const sdm_vdb_opts opts = {0};
        sdm_vdb_report report;
        if (sdm_vdb_write(path, &grid, values, &opts, &report, &e)) fail_msg("shape %d: %s", (int)i, e.text);
        if (sdm_vdb_verify(path, NULL, &e)) fail_msg("shape %d: %s", (int)i, e.text);
        // mending is local: a tenth of the band at most, where features are thinner than a voxel of 0.2 mm
        assert_true(report.adjusted_voxels <= report.active_voxels / 10);
        assert_true(report.adjusted_mm < 0.4);
    }
    remove(path);
    sdm_free(values);
    sdm_instance_free(cochlea);
    sdm_registry_free(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_cochlea_becomes_a_level_set)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
