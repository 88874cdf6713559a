/* Narrow-band maps in blocks on random meshes and grids (turned, with voxels of three sizes, thin):
 * the same bits as the dense narrow-band map, for any number of threads and instruction set.
 * Usage: test_exact_blocks [MESHES [FIRST]]
 * Tests: map_blocks.c grid_blocks.c sign_blocks.c */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include "oracle/exact_subject.h"
#include "sdm/internal/processor.h"

static uint64_t n_meshes = 200, first;

static float value_of(const sdm_blocks *b, int64_t i, int64_t j, int64_t k)
{
    const int64_t s = SDM_BLOCK_SIZE;
    const uint32_t tile = b->tile[(k / s * b->n[1] + j / s) * b->n[0] + i / s];
    if (tile == SDM_TILE_OUTSIDE) return (float)b->band_mm;
    if (tile == SDM_TILE_INSIDE) return -(float)b->band_mm;
    assert_true(tile < b->n_block && b->first[tile][0] == i / s * s &&
                b->first[tile][1] == j / s * s && b->first[tile][2] == k / s * s);
    return b->values[tile][(k % s * s + j % s) * s + i % s];
}

static void check_blocks(const subject *s, const sdm_blocks *b, const float *map)
{
    const sdm_grid *g = &b->grid;
    size_t used = 0;
    for (int64_t k = 0; k < b->n[2] * SDM_BLOCK_SIZE; k++)
        for (int64_t j = 0; j < b->n[1] * SDM_BLOCK_SIZE; j++)
            for (int64_t i = 0; i < b->n[0] * SDM_BLOCK_SIZE; i++) {
                const double at[3] = {(double)i, (double)j, (double)k};
                const float found = value_of(b, i, j, k);
                if (i < g->n[0] && j < g->n[1] && k < g->n[2]) {
                    const float expected = map[(k * g->n[1] + j) * g->n[0] + i];
                    CHECK(found == expected, s, at, "voxel is %.9g, in the map %.9g", (double)found,
                          (double)expected);
                } else {
                    CHECK(fabsf(found) == (float)b->band_mm, s, at, "%.9g beyond the grid",
                          (double)found);
                }
            }
    for (size_t i = 0; i < b->n_block; i++) {
        bool near = false, in = false, out = false;
        for (int v = 0; v < SDM_BLOCK_VOXELS; v++) {
            near = near || fabsf(b->values[i][v]) < (float)b->band_mm;
            in = in || b->values[i][v] < 0;
            out = out || b->values[i][v] > 0;
        }
        used += near || (in && out);
    }
    assert_int_equal(used, b->n_block);
}

static void test_blocks(void **state)
{
    (void)state;
    sdm_error err = {0};
    size_t closed = 0;
    for (uint64_t i = first; i < first + n_meshes; i++) {
        subject s;
        subject_make(&s, i, &(sdm_exact_opts){.n_threads = 1 + (int)(i % 3)});
        bool exact;
        sdm_grid g = random_grid(&s, &exact);
        for (int a = 0; a < 3; a++) g.n[a] = g.n[a] > 1 ? 3 * g.n[a] : 1;
        for (int a = 0; a < 3; a++) g.spacing[a] /= 2;
        const double band = s.size * power_of_ten(&s.dice, -2.5, -0.5);
        sdm_blocks b, c;
        const sdm_status st = sdm_exact_map_blocks(s.engine, &g, band, &b, &err);
        if (s.report->sign != SDM_SIGN_CROSSINGS) {
            assert_int_equal(st, SDM_E_ARG);
            subject_dispose(&s);
            continue;
        }
        closed++;
        if (st) fail_msg("%s", err.text);
        float *map = malloc(sdm_grid_count(&g) * sizeof *map);
        const sdm_exact_layers layers = {.values = map, .band_mm = band};
        if (sdm_exact_map_layers(s.engine, &g, &layers, &err)) fail_msg("%s", err.text);
        check_blocks(&s, &b, map);
        // another instruction set
        sdm_processor_select(SDM_PROCESSOR_BASELINE);
        if (sdm_exact_map_blocks(s.engine, &g, band, &c, &err)) fail_msg("%s", err.text);
        sdm_processor_select(-1);
        assert_int_equal(b.n_block, c.n_block);
        assert_memory_equal(b.values, c.values, b.n_block * sizeof *b.values);
        sdm_blocks_dispose(&c);
        sdm_blocks_dispose(&b);
        assert_null(b.values);
        free(map);
        subject_dispose(&s);
    }
    assert_true(closed > n_meshes / 4);
}

/* A large sphere-like mesh on a fine grid: memory grows with the surface. Wrong arguments. */
static void test_memory_and_arguments(void **state)
{
    (void)state;
    sdm_error err = {0};
    sdm_mesh m = {0};
    subject s = {0};
    mesh_box(&m, (const double[]){-0.5, -0.5, -0.5}, (const double[]){0.5, 0.5, 0.5});
    sdm_exact *e = engine_of(&s, &m, &(sdm_exact_opts){.memory_limit = (size_t)400 << 20});
    const int64_t n[3] = {1000, 1000, 1000};
    const double centre[3] = {0, 0, 0};
    const sdm_grid g = sdm_grid_centred(n, 0.0015, centre);
    sdm_blocks b;
    if (sdm_exact_map_blocks(e, &g, 3 * 0.0015, &b, &err)) fail_msg("%s", err.text);
    // six faces of 667^2 voxels
    assert_in_range(b.n_block, 6 * 80 * 80, 6 * 86 * 86 * 2);
    assert_true(b.tile[(62 * 125 + 62) * 125 + 62] == SDM_TILE_INSIDE);
    assert_true(b.tile[0] == SDM_TILE_OUTSIDE);
    sdm_blocks_dispose(&b);
    assert_int_equal(sdm_exact_map_blocks(e, &g, 0, &b, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_blocks(e, &g, NAN, &b, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_blocks(e, NULL, 1, &b, &err), SDM_E_ARG);
    assert_int_equal(sdm_exact_map_blocks(e, &g, 0.5, &b, &err), SDM_E_NOMEM);
    sdm_exact_free(e);
    sdm_mesh_dispose(&m);
}

int main(int argc, char **argv)
{
    subject_range(argc, argv, &n_meshes, &first);
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_blocks),
        cmocka_unit_test(test_memory_and_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
