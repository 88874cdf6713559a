/* Level sets of cochleas, which have creases, sheets and gaps thinner than a voxel, where OpenVDB's
 * checkLevelSet still requires a gradient of 1. Each must be written, pass the check, keep the side
 * of every voxel and stay close to its map.
 * Level sets from blocks equal those from dense maps. Tests: vdb.cc vdb_creases.cc map_blocks.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

#include <cmocka.h>

#include "sdm/builtin_shapes.h"
#include "sdm/exact.h"
#include "sdm/internal/block_border.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "sdm/runtime.h"
#include "sdm/vdb.h"

enum { SHAPES = 30 };

static sdm_registry *registry;
static sdm_instance *cochlea;

static int set_up(void **state)
{
    (void)state;
    return sdm_registry_create(&registry, NULL) || sdm_builtin_shapes_add(registry, NULL) ||
           sdm_instance_create(sdm_registry_find(registry, "cochlea", NULL), NULL, 0, NULL,
                               &cochlea, NULL);
}

static int tear_down(void **state)
{
    (void)state;
    sdm_instance_free(cochlea);
    sdm_registry_free(registry);
    return 0;
}

// Writes the level set of a cochlea and reads it back. At most the share `share` of the band may be
// changed.
static void level_set_check(const double *params, const sdm_grid *grid, double share)
{
    const char *path = "cochlea_level_set.vdb";
    const size_t count = sdm_grid_count(grid);
    sdm_error e = {0};
    float *values, *back;
    int32_t *index;
    assert_int_equal(SDM_ALLOC(&values, count, "map", &e), SDM_OK);
    assert_int_equal(SDM_ALLOC(&back, count, "map", &e), SDM_OK);
    assert_int_equal(SDM_ALLOC(&index, 3 * count, "map", &e), SDM_OK);
    if (sdm_exact_shape_map(cochlea, params, NULL, grid, values, NULL, &e)) fail_msg("%s", e.text);
    const sdm_vdb_opts opts = {0};
    sdm_vdb_report report;
    if (sdm_vdb_write(path, grid, values, &opts, &report, &e)) fail_msg("%s", e.text);
    if (sdm_vdb_verify(path, NULL, &e)) fail_msg("%s", e.text);
    for (size_t i = 0; i < count; i++) {
        const size_t nx = (size_t)grid->n[0], ny = (size_t)grid->n[1];
        const size_t at[3] = {i % nx, i / nx % ny, i / nx / ny};
        for (size_t k = 0; k < 3; k++) index[3 * i + k] = (int32_t)at[k];
    }
    if (sdm_vdb_sample(path, index, count, back, &e)) fail_msg("%s", e.text);
    size_t flipped = 0;
    for (size_t i = 0; i < count; i++) flipped += (back[i] < 0) != (values[i] < 0);
    if (!report.cut && flipped) fail_msg("%zu voxels have changed sides", flipped);
    assert_true((double)report.adjusted_voxels <= share * (double)report.active_voxels);
    assert_true(report.adjusted_mm < grid->spacing[0]);
    remove(path);
    sdm_free(values);
    sdm_free(back);
    sdm_free(index);
}

static void every_cochlea_becomes_a_level_set(void **state)
{
    (void)state;
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[]){60, 50, 50}, 0.2, (const double[]){0.5, 0.4, 1.2});
    size_t n;
    const sdm_param *p = sdm_instance_params(cochlea, &n);
    for (uint64_t i = 0; i < SHAPES; i++) {
        double at[8];
        for (size_t k = 0; k < n; k++)
            at[k] = p[k].min + (p[k].max - p[k].min) * sdm_rng_uniform(7, i, k);
        level_set_check(at, &grid, 0.1);
    }
}

static void coarse_and_fine_grids_become_level_sets(void **state)
{
    (void)state;
    const double spacing[] = {0.4, 0.3, 0.15};
    size_t n;
    const sdm_param *p = sdm_instance_params(cochlea, &n);
    double at[8];
    for (size_t k = 0; k < n; k++) at[k] = p[k].def;
    for (size_t i = 0; i < 3; i++) {
        const int64_t size[3] = {(int64_t)(14 / spacing[i]), (int64_t)(12 / spacing[i]),
                                 (int64_t)(12 / spacing[i])};
        const sdm_grid grid = sdm_grid_centred(size, spacing[i], (const double[]){0.5, 0.4, 1.2});
        level_set_check(at, &grid, 0.15);
    }
}

/* The level set from blocks has the same values, tiles and activity as that from the dense map (the
   hash covers all of them), with 32 and 16 bits; blocks with another band, or with a band that
   leaves the grid, are refused. */
static void blocks_become_the_same_level_set(void **state)
{
    (void)state;
    const char *path = "cochlea_blocks.vdb";
    const sdm_grid grid =
        sdm_grid_centred((const int64_t[]){83, 72, 61}, 0.15, (const double[]){0.5, 0.4, 1.2});
    const sdm_grid small =
        sdm_grid_centred((const int64_t[]){40, 40, 40}, 0.15, (const double[]){0.5, 0.4, 1.2});
    sdm_error e = {0};
    sdm_mesh mesh = {0};
    sdm_exact *engine;
    sdm_blocks blocks;
    size_t n;
    const sdm_param *p = sdm_instance_params(cochlea, &n);
    double at[8], band;
    for (size_t k = 0; k < n; k++) at[k] = p[k].def;
    if (sdm_instance_mesh(cochlea, at, &mesh, &e)) fail_msg("%s", e.text);
    if (sdm_exact_create(&mesh, NULL, &engine, &e)) fail_msg("%s", e.text);
    float *values = NULL;
    if (SDM_ALLOC(&values, sdm_grid_count(&grid), "map", &e)) fail_msg("%s", e.text);
    if (sdm_exact_map(engine, &grid, values, &e)) fail_msg("%s", e.text);
    for (int half = 0; half < 2; half++) {
        const sdm_vdb_opts opts = {.half = half};
        sdm_vdb_report dense, sparse;
        if (sdm_vdb_write(path, &grid, values, &opts, &dense, &e)) fail_msg("%s", e.text);
        if (sdm_vdb_band(&grid, &opts, &band, &e)) fail_msg("%s", e.text);
        if (sdm_exact_map_blocks(engine, &grid, band, &blocks, &e)) fail_msg("%s", e.text);
        assert_false(sdm_blocks_reach_border(&blocks));
        if (sdm_vdb_write_blocks(path, &blocks, &opts, &sparse, &e)) fail_msg("%s", e.text);
        if (sdm_vdb_verify(path, NULL, &e)) fail_msg("%s", e.text);
        assert_true(dense.active_voxels == sparse.active_voxels && dense.hash == sparse.hash);
        assert_true(dense.adjusted_voxels == sparse.adjusted_voxels && !sparse.cut);
        sdm_blocks_dispose(&blocks);
    }
    remove(path);
    // another band; a whole map; a band that leaves the grid
    if (sdm_exact_map_blocks(engine, &grid, 2 * band, &blocks, &e)) fail_msg("%s", e.text);
    assert_int_equal(sdm_vdb_write_blocks(path, &blocks, NULL, NULL, &e), SDM_E_ARG);
    assert_int_equal(sdm_vdb_write_blocks(path, &blocks, &(sdm_vdb_opts){.dense = true}, NULL, &e),
                     SDM_E_ARG);
    sdm_blocks_dispose(&blocks);
    if (sdm_vdb_band(&small, NULL, &band, &e)) fail_msg("%s", e.text);
    if (sdm_exact_map_blocks(engine, &small, band, &blocks, &e)) fail_msg("%s", e.text);
    assert_true(sdm_blocks_reach_border(&blocks));
    assert_int_equal(sdm_vdb_write_blocks(path, &blocks, NULL, NULL, &e), SDM_E_ARG);
    assert_int_equal(sdm_vdb_write_blocks(path, NULL, NULL, NULL, &e), SDM_E_ARG);
    sdm_blocks_dispose(&blocks);
    sdm_free(values);
    sdm_exact_free(engine);
    sdm_mesh_dispose(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(every_cochlea_becomes_a_level_set),
                                       cmocka_unit_test(coarse_and_fine_grids_become_level_sets),
                                       cmocka_unit_test(blocks_become_the_same_level_set)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
