/* Level sets written from maps in blocks are those written from whole maps: the same hash of all
 * values, the same report, the same refusals.
 * Tests: map_blocks.c padded.c vdb.cc vdb_blocks.cc */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#include "sdm/memory.h"
#include "sdm/vdb.h"

#define FILE_NAME "test_vdb_blocks.vdb"

typedef double (*distance)(const double x[3]);

static double ball(const double x[3], double r)
{
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - r;
}
static double sphere(const double x[3]) { return ball(x, 1.3); }
static double near_border(const double x[3]) { return ball(x, 2.1); }
static double cut(const double x[3]) { return ball(x, 2.9); }
static double shell(const double x[3]) { return fabs(ball(x, 1.3)) - 0.35; }
static double all_outside(const double x[3]) { return ball(x, 1) + 50; }
static double all_inside(const double x[3]) { return ball(x, 1) - 50; }
static double step(const double x[3]) { return ball(x, 1.3) < 0 ? -5 : 5; }
/* jumps at faces of the block whose corner is the origin, and nowhere else */
static double block_step(const double x[3])
{
    bool in = true;
    for (int a = 0; a < 3; a++) in = in && x[a] > -0.01 && x[a] < 7.5 * 0.16;
    return in ? -5 : 5;
}
static double cube(const double x[3])
{
    const double q[3] = {fabs(x[0]) - 1.1, fabs(x[1]) - 1.0, fabs(x[2]) - 0.9};
    double out = 0, in = -INFINITY;
    for (int a = 0; a < 3; a++) {
        out += q[a] > 0 ? q[a] * q[a] : 0;
        in = fmax(in, q[a]);
    }
    return in > 0 ? sqrt(out) : in;
}

static float *map_fill(const sdm_grid *g, distance f)
{
    float *v = malloc(sdm_grid_count(g) * sizeof *v), *to = v;
    assert_non_null(v);
    for (int64_t k = 0; k < g->n[2]; k++)
        for (int64_t j = 0; j < g->n[1]; j++)
            for (int64_t i = 0; i < g->n[0]; i++) {
                double x[3];
                sdm_grid_world(g, (const double[]){(double)i, (double)j, (double)k}, x);
                *to++ = (float)f(x);
            }
    return v;
}

/* The values of a block; beyond the end of the grid a number that must have no effect. */
static void cut_block(const sdm_grid *g, const float *map, const int64_t at[3], float *to)
{
    for (int64_t i = 0; i < SDM_BLOCK_VOXELS; i++, to++) {
        const int64_t v[3] = {8 * at[0] + i % 8, 8 * at[1] + i / 8 % 8, 8 * at[2] + i / 64};
        const bool in = v[0] < g->n[0] && v[1] < g->n[1] && v[2] < g->n[2];
        *to = in ? map[(v[2] * g->n[1] + v[1]) * g->n[0] + v[0]] : -0.01f;
    }
}

/* Whether values of a block lie in the band or have both signs. */
static bool is_near(const sdm_grid *g, const int64_t at[3], const float *values, double width)
{
    size_t all = 0, outside = 0, inside = 0;
    for (int64_t i = 0; i < SDM_BLOCK_VOXELS; i++) {
        const int64_t v[3] = {8 * at[0] + i % 8, 8 * at[1] + i / 8 % 8, 8 * at[2] + i / 64};
        if (!(v[0] < g->n[0] && v[1] < g->n[1] && v[2] < g->n[2])) continue;
        all++;
        outside += (double)values[i] >= width;
        inside += (double)values[i] <= -width;
    }
    return outside != all && inside != all;
}

static sdm_blocks blocks_of(const sdm_grid *g, const float *map, double width)
{
    sdm_blocks b = {.grid = *g, .band_mm = width};
    for (int a = 0; a < 3; a++) b.n[a] = (g->n[a] + 7) / 8;
    const size_t n = (size_t)(b.n[0] * b.n[1] * b.n[2]);
    assert_false(SDM_ALLOC(&b.tile, n, "tiles", NULL));
    assert_false(SDM_ALLOC(&b.first, n, "places", NULL));
    assert_false(SDM_ALLOC(&b.values, n, "values", NULL));
    for (size_t i = 0; i < n; i++) {
        const int64_t at[3] = {(int64_t)i % b.n[0], (int64_t)i / b.n[0] % b.n[1],
                               (int64_t)i / b.n[0] / b.n[1]};
        float *values = b.values[b.n_block];
        cut_block(g, map, at, values);
        for (int a = 0; a < 3; a++) b.first[b.n_block][a] = (int32_t)(8 * at[a]);
        b.tile[i] = is_near(g, at, values, width) ? (uint32_t)b.n_block++
                    : values[0] < 0               ? SDM_TILE_INSIDE
                                                  : SDM_TILE_OUTSIDE;
    }
    return b;
}

static sdm_grid test_grid(void)
{
    return sdm_grid_centred((const int64_t[]){44, 39, 32}, 0.16, (const double[]){0.03, 0.01, 0});
}

/* Writes both and compares. */
static void check(const sdm_grid *g, distance f, const sdm_vdb_opts *o, bool is_cut)
{
    float *map = map_fill(g, f);
    double width;
    sdm_error err;
    sdm_vdb_report whole, part;
    if (sdm_vdb_band(g, o, &width, &err)) fail_msg("%s", err.text);
    sdm_blocks b = blocks_of(g, map, width);
    if (sdm_vdb_write(FILE_NAME, g, map, o, &whole, &err)) fail_msg("%s", err.text);
    if (sdm_vdb_write_blocks(FILE_NAME, &b, o, &part, &err)) fail_msg("%s", err.text);
    assert_true(whole.hash == part.hash && whole.active_voxels == part.active_voxels);
    assert_true(whole.cut == part.cut && whole.cut == is_cut);
    assert_true(whole.adjusted_voxels == part.adjusted_voxels &&
                whole.adjusted_mm == part.adjusted_mm);
    assert_true(part.active_voxels > 1000);
    if (sdm_vdb_verify(FILE_NAME, NULL, &err)) fail_msg("%s", err.text);
    unlink(FILE_NAME);
    sdm_blocks_dispose(&b);
    free(map);
}

static void test_same_as_the_map(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    sdm_grid turned = g;
    const double c = cos(0.4), s = sin(0.4), dir[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    memcpy(turned.dir, dir, sizeof dir);
    turned.origin[0] = -2.2, turned.origin[1] = -3.9;
    const sdm_vdb_opts wide = {.band_voxels = 5}, half = {.half = true};
    check(&g, sphere, NULL, false);
    check(&g, shell, &wide, false);
    check(&g, cube, NULL, false); // creases are mended
    check(&g, sphere, &half, false);
    check(&turned, sphere, NULL, false);
}

static void test_border(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    check(&g, near_border, NULL, false); // the band leaves the grid
    check(&g, cut, NULL, true);          // the surface leaves the grid
    check(&g, all_inside, NULL, true);
}

static void refuse(const sdm_grid *g, distance f, sdm_status status)
{
    float *map = map_fill(g, f);
    sdm_blocks b = blocks_of(g, map, 3 * 0.16 * (1 + 1e-6));
    sdm_error whole, part;
    assert_int_equal(sdm_vdb_write(FILE_NAME, g, map, NULL, NULL, &whole), status);
    assert_int_equal(sdm_vdb_write_blocks(FILE_NAME, &b, NULL, NULL, &part), status);
    assert_string_equal(whole.text, part.text);
    assert_int_not_equal(access(FILE_NAME, F_OK), 0);
    sdm_blocks_dispose(&b);
    free(map);
}

static void test_refused(void **state)
{
    (void)state;
    const sdm_grid g = test_grid();
    refuse(&g, all_outside, SDM_E_ARG);
    refuse(&g, step, SDM_E_QUALITY);
    sdm_grid blocks = g;
    for (int a = 0; a < 3; a++) blocks.origin[a] = -16 * 0.16;
    refuse(&blocks, block_step, SDM_E_QUALITY);
    // a band that is too narrow, a whole map, no band
    float *map = map_fill(&g, sphere);
    sdm_blocks b = blocks_of(&g, map, 0.4);
    sdm_error err;
    assert_int_equal(sdm_vdb_write_blocks(FILE_NAME, &b, NULL, NULL, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "band of 0.4 mm"));
    const sdm_vdb_opts dense = {.dense = true};
    assert_int_equal(sdm_vdb_write_blocks(FILE_NAME, &b, &dense, NULL, &err), SDM_E_ARG);
    sdm_blocks_dispose(&b);
    assert_int_equal(sdm_vdb_write_blocks(FILE_NAME, &b, NULL, NULL, &err), SDM_E_ARG);
    double width;
    sdm_grid long_voxels = g;
    long_voxels.spacing[1] = 0.2;
    assert_int_equal(sdm_vdb_band(&long_voxels, NULL, &width, &err), SDM_E_ARG);
    free(map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_same_as_the_map),
        cmocka_unit_test(test_border),
        cmocka_unit_test(test_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
