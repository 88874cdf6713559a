/* The volume of a map: solids of known volume, any grid, any number of threads.
 * Tests: map_volume.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "sdm/map.h"
#include "sdm/memory.h"

enum { N = 40 };

static double ball(const double x[3]) { return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - 5; }

static double torus(const double x[3]) { return hypot(hypot(x[0], x[1]) - 5, x[2]) - 2; }

static double box(const double x[3])
{
    const double half[3] = {5, 4, 3};
    double square = 0, most = -INFINITY;
    for (int a = 0; a < 3; a++) {
        const double beyond = fabs(x[a]) - half[a];
        square += pow(fmax(beyond, 0), 2), most = fmax(most, beyond);
    }
    return sqrt(square) + fmin(most, 0);
}

// A grid of voxels of 0.5 mm, moved and turned, that holds the solids.
static sdm_grid grid_of(double turn)
{
    sdm_grid g = sdm_grid_centred((int64_t[3]){N, N, N}, 0.5, (double[3]){0.1, -0.07, 0.21});
    const double c = cos(turn), s = sin(turn), dir[9] = {c, -s, 0, s, c, 0, 0, 0, 1};
    for (int i = 0; i < 9; i++) g.dir[i] = dir[i];
    const double middle[3] = {(N - 1) / 2.0, (N - 1) / 2.0, (N - 1) / 2.0};
    double at[3];
    for (int a = 0; a < 3; a++) g.origin[a] = 0;
    sdm_grid_world(&g, middle, at);
    for (int a = 0; a < 3; a++) g.origin[a] = 0.13 * (a + 1) - at[a];
    return g;
}

static float map[N * N * N];

static void fill(const sdm_grid *g, double (*distance)(const double x[3]))
{
    for (int64_t v = 0; v < N * N * N; v++) {
        const double index[3] = {(double)(v % N), (double)(v / N % N), (double)(v / (N * N))};
        double x[3];
        sdm_grid_world(g, index, x);
        map[v] = (float)distance(x);
    }
}

static void known_volumes(void **state)
{
    (void)state;
    const double pi = acos(-1);
    const struct {
        double (*distance)(const double x[3]);
        double volume, error;
    } solids[] = {
        {ball, 4 * pi / 3 * 125, 5e-4}, {torus, 2 * pi * pi * 20, 1e-3}, {box, 480, 1e-3}};
    for (size_t i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++) {
            const sdm_grid g = grid_of(0.4 * k);
            double volume = 0, again = 0;
            fill(&g, solids[i].distance);
            assert_int_equal(sdm_map_volume(&g, map, 1, &volume, NULL), SDM_OK);
            if (fabs(volume / solids[i].volume - 1) > solids[i].error)
                fail_msg("solid %zu: %.10g mm^3, not %.10g", i, volume, solids[i].volume);
            assert_int_equal(sdm_map_volume(&g, map, 3, &again, NULL), SDM_OK);
            assert_true(again == volume);
        }
}

// The adjoint is the derivative of the volume along a change of the map, here a growing solid,
// whose volume grows by its area; and along a change of one voxel.
static void adjoint(void **state)
{
    (void)state;
    static float slope[N * N * N], again[N * N * N];
    const sdm_grid g = grid_of(0.4);
    const double pi = acos(-1);
    double sum = 0, low = 0, high = 0;
    fill(&g, ball);
    assert_int_equal(sdm_map_volume_adjoint(&g, map, 1, slope, NULL), SDM_OK);
    assert_int_equal(sdm_map_volume_adjoint(&g, map, 3, again, NULL), SDM_OK);
    assert_memory_equal(slope, again, sizeof slope);
    int64_t at = 0;
    for (int64_t v = 0; v < N * N * N; v++) {
        sum -= (double)slope[v];
        if (fabs((double)map[v] - 0.2) < fabs((double)map[at] - 0.2)) at = v;
    }
    if (fabs(sum / (100 * pi) - 1) > 2e-3) fail_msg("area %.8g, not %.8g", sum, 100 * pi);
    const float here = map[at];
    map[at] = here - 0.01f;
    assert_int_equal(sdm_map_volume(&g, map, 1, &low, NULL), SDM_OK);
    map[at] = here + 0.01f;
    assert_int_equal(sdm_map_volume(&g, map, 1, &high, NULL), SDM_OK);
    const double wanted = (high - low) / 0.02;
    if (!(wanted < -0.05) || fabs((double)slope[at] - wanted) > 2e-3 * fabs(wanted))
        fail_msg("slope %.8g, by differences %.8g", (double)slope[at], wanted);
}

static void bad_arguments(void **state)
{
    (void)state;
    sdm_grid g = grid_of(0);
    double volume = -1;
    fill(&g, ball);
    assert_int_equal(sdm_map_volume(NULL, map, 0, &volume, NULL), SDM_E_ARG);
    assert_int_equal(sdm_map_volume(&g, NULL, 0, &volume, NULL), SDM_E_ARG);
    assert_int_equal(sdm_map_volume(&g, map, 0, NULL, NULL), SDM_E_ARG);
    assert_int_equal(sdm_map_volume(&g, map, -1, &volume, NULL), SDM_E_ARG);
    assert_int_equal(sdm_map_volume_adjoint(NULL, map, 0, map, NULL), SDM_E_ARG);
    assert_int_equal(sdm_map_volume_adjoint(&g, map, 0, NULL, NULL), SDM_E_ARG);
    map[7] = NAN;
    assert_int_equal(sdm_map_volume(&g, map, 0, &volume, NULL), SDM_E_ARG);
    g.n[0] = 0;
    assert_int_equal(sdm_map_volume(&g, map, 0, &volume, NULL), SDM_E_ARG);
    assert_true(volume == -1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_volumes),
        cmocka_unit_test(adjoint),
        cmocka_unit_test(bad_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
