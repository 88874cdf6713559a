/* Kernels of the `template` network for derivatives in reverse mode, for every instruction set of
 * the processor: the same bits, and the transposes of the other kernels.
 * Tests: template_kernels_avx2.c template_kernels_avx512.c template_kernels_generic.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/rng.h"
#include "template_tables.h"

// A lattice of nodes, N points in it.
enum { NX = 6, NY = 5, NZ = 7, NODES = NX * NY * NZ, N = 37, ROOM = 64, VOXELS = 64 };

static void fill(float *v, size_t n, uint64_t stream, double low, double high)
{
    for (size_t i = 0; i < n; i++)
        v[i] = (float)(low + (high - low) * sdm_rng_uniform(31, stream, i));
}

// found[n] of the table number t is near expected[n]; first[n]: that of the first table.
static void check(size_t t, const float *found, const double *expected, size_t n, float *first)
{
    for (size_t i = 0; i < n; i++)
        if (!(fabs((double)found[i] - expected[i]) < 2e-5))
            fail_msg("table %zu, element %zu: %.9g, not %.9g", t, i, (double)found[i], expected[i]);
    if (t == 0) memcpy(first, found, n * sizeof *first);
    assert_memory_equal(first, found, n * sizeof *first);
}

// The weight of a station at a voxel.
static double cubic(const template_expansion *e, const size_t station[3], const size_t voxel[3])
{
    double weight = 1;
    for (int a = 0; a < 3; a++) weight *= (double)e->cubic[station[a]][voxel[a]];
    return weight;
}

static double linear(const template_expansion *e, const size_t station[3], const size_t voxel[3])
{
    double weight = 1;
    for (int a = 0; a < 3; a++) {
        const double t = (double)e->linear[voxel[a]];
        weight *= station[a] ? t : 1 - t;
    }
    return weight;
}

static void stations_get_the_adjoints_of_the_voxels(void **state)
{
    (void)state;
    enum { POINTS = 4 * NX * NY * 4, METRIC = 8 * NX * NY * 2 };
    template_expansion e;
    float rows[9][VOXELS], start[POINTS + METRIC], first[POINTS + METRIC];
    const float *c[9];
    double expected[POINTS + METRIC];
    fill(e.cubic[0], 16, 0, -1, 1);
    fill(e.linear, 4, 1, 0, 1);
    fill(rows[0], 9 * VOXELS, 2, -1, 1);
    fill(start, POINTS + METRIC, 3, -1, 1);
    for (int a = 0; a < 9; a++) c[a] = rows[a];
    for (size_t i = 0; i < POINTS + METRIC; i++) expected[i] = (double)start[i];
    for (size_t i = 0; i < 64; i++)
        for (size_t v = 0; v < VOXELS; v++) {
            const size_t at[3] = {i % 4, i / 4 % 4, i / 16}, voxel[3] = {v % 4, v / 4 % 4, v / 16},
                         node = (at[2] * NY + at[1]) * NX + at[0];
            for (size_t a = 0; a < 3; a++)
                expected[4 * node + a] += cubic(&e, at, voxel) * (double)rows[a][v];
            if (at[0] > 1 || at[1] > 1 || at[2] > 1) continue;
            for (size_t a = 0; a < 6; a++)
                expected[POINTS + 8 * node + a] += linear(&e, at, voxel) * (double)rows[3 + a][v];
        }
    for (size_t t = 0; t < n_tables; t++) {
        float found[POINTS + METRIC];
        memcpy(found, start, sizeof found);
        tables[t]->expand_back(&e, c, NX, NX * NY, found, found + POINTS);
        check(t, found, expected, POINTS + METRIC, first);
    }
}

static void corners_get_the_adjoints_of_the_block(void **state)
{
    (void)state;
    enum { LINE = 12, CORNERS = 4 * LINE };
    float value[VOXELS], start[CORNERS], first[CORNERS];
    double expected[CORNERS];
    fill(value, VOXELS, 4, -1, 1);
    fill(start, CORNERS, 5, -1, 1);
    for (size_t i = 0; i < CORNERS; i++) {
        float corner[CORNERS] = {0}, unit[VOXELS];
        corner[i] = 1;
        tables[0]->block(corner, LINE, 2 * LINE, unit);
        expected[i] = (double)start[i];
        for (size_t v = 0; v < VOXELS; v++) expected[i] += (double)(unit[v] * value[v]);
    }
    for (size_t t = 0; t < n_tables; t++) {
        float found[CORNERS];
        memcpy(found, start, sizeof found);
        tables[t]->block_back(value, LINE, 2 * LINE, found);
        check(t, found, expected, CORNERS, first);
    }
}

static void nodes_get_the_adjoints_of_the_correction(void **state)
{
    (void)state;
    float map[NODES], u[3][ROOM], value[ROOM], start[NODES], first[NODES];
    double expected[NODES];
    template_correction c = {
        .map = map, .n = {NX, NY, NZ}, .scale = 0.7f, .offset = {-0.3f, 0.2f, 0.4f}};
    const float *const at[3] = {u[0], u[1], u[2]};
    fill(u[0], 3 * ROOM, 6, -2, 11); // within the lattice and beyond its ends
    fill(value, ROOM, 7, -1, 1);
    fill(start, NODES, 8, -1, 1);
    value[5] = 0;
    for (size_t i = 0; i < NODES; i++) {
        float unit[ROOM] = {0};
        memset(map, 0, sizeof map);
        map[i] = 1;
        tables[0]->correct(&c, N, at, unit);
        expected[i] = (double)start[i];
        for (size_t v = 0; v < N; v++) expected[i] += (double)(unit[v] * value[v]);
    }
    for (size_t t = 0; t < n_tables; t++) {
        float found[NODES];
        memcpy(found, start, sizeof found);
        tables[t]->correct_back(&c, N, at, value, found);
        check(t, found, expected, NODES, first);
    }
}

static void control_points_get_the_adjoints_of_the_displacement(void **state)
{
    (void)state;
    enum { FLOATS = 4 * NODES };
    static float control[FLOATS], start[FLOATS], first[FLOATS], found[FLOATS];
    static double expected[FLOATS];
    const template_warp w = {
        .control = control, .n = {NX, NY, NZ}, .origin = {-2, 1, -3}, .spacing = 1.25};
    for (uint64_t i = 0; i < 8; i++) {
        float sum[4][4];
        double y[3];
        template_place place;
        for (uint64_t a = 0; a < 3; a++)
            y[a] = w.origin[a] + w.spacing * (w.n[a] + 1) * sdm_rng_uniform(37, a, i) - 1;
        fill(sum[0], 16, 9 + i, -1, 1);
        fill(start, FLOATS, 40 + i, -1, 1);
        tables[0]->find_place(&w, y, &place);
        for (size_t k = 0; k < FLOATS; k++) {
            float unit[4][4];
            memset(control, 0, sizeof control);
            control[k] = 1;
            tables[0]->displace(&w, &place, unit);
            expected[k] = (double)start[k];
            for (int d = 0; d < 16; d++)
                expected[k] += (double)(unit[d / 4][d % 4] * sum[d / 4][d % 4]);
        }
        for (size_t t = 0; t < n_tables; t++) {
            memcpy(found, start, sizeof found);
            tables[t]->displace_back(&w, &place, (const float(*)[4])sum, found);
            check(t, found, expected, FLOATS, first);
        }
    }
}

int main(void)
{
    find_tables();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stations_get_the_adjoints_of_the_voxels),
        cmocka_unit_test(corners_get_the_adjoints_of_the_block),
        cmocka_unit_test(nodes_get_the_adjoints_of_the_correction),
        cmocka_unit_test(control_points_get_the_adjoints_of_the_displacement)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
