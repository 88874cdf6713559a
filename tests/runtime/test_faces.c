/* Distances outside of a level set's grid: against a search over all faces at the border.
 * Tests: faces.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>

#include <cmocka.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "vdb/faces.h"

#define VOXEL 0.3

// Distance half a voxel outside of border voxel b, on the face along +-axis: the value at b
// extrapolated by half of the last difference; 0 if negative (inside).
static double face_distance(const sdm_grid *g, const float *v, const int64_t b[3], int axis,
                            bool low)
{
    const int64_t step[3] = {1, g->n[0], g->n[0] * g->n[1]},
                  at = b[0] + b[1] * step[1] + b[2] * step[2];
    const double here = (double)v[at];
    const double next = g->n[axis] > 1 ? (double)v[at + (low ? 1 : -1) * step[axis]] : here;
    const double on = 0.5 * (here - next), most = 0.5 * VOXEL;
    const double d = here + (on > most ? most : on < -most ? -most : on);
    return d > 0 ? d : 0;
}

static double distance_by_search(const sdm_grid *g, const float *v, const int64_t p[3], double most)
{
    double best = most;
    for (int axis = 0; axis < 3; axis++) {
        if (p[axis] >= 0 && p[axis] < g->n[axis]) continue;
        const bool low = p[axis] < 0;
        const int e = (axis + 1) % 3, f = (axis + 2) % 3;
        int64_t b[3];
        b[axis] = low ? 0 : g->n[axis] - 1;
        const double away = fabs((double)(p[axis] - b[axis])) - 0.5;
        for (b[e] = 0; b[e] < g->n[e]; b[e]++)
            for (b[f] = 0; b[f] < g->n[f]; b[f]++) {
                // inside: the whole face of the voxel counts, not only its centre
                const double d = face_distance(g, v, b, axis, low), reach = d > 0 ? 0 : 0.5;
                const double x = fmax(fabs((double)(p[e] - b[e])) - reach, 0),
                             y = fmax(fabs((double)(p[f] - b[f])) - reach, 0);
                best = fmin(best, VOXEL * sqrt(away * away + x * x + y * y) + d);
            }
    }
    return best;
}

// Test maps: a ball far from the faces of the grid, a ball across them, and noise that is no
// distance map.
static float map_value(int kind, const int64_t at[3], uint64_t i)
{
    static const double middle[3][3] = {{4, 3, 5}, {0, 6, 2}, {0, 0, 0}};
    if (kind == 2) return (float)(3 * sdm_rng_uniform(1, 2, i) - 0.3);
    double sum = 0;
    for (int a = 0; a < 3; a++)
        sum += ((double)at[a] - middle[kind][a]) * ((double)at[a] - middle[kind][a]);
    return (float)(VOXEL * (sqrt(sum) - 2.2));
}

static void faces_check(const int64_t n[3], int kind)
{
    const double origin[3] = {0, 0, 0};
    const sdm_grid g = sdm_grid_centred(n, VOXEL, origin);
    float *v = malloc(sdm_grid_count(&g) * sizeof *v);
    assert_non_null(v);
    size_t count = 0;
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++)
            for (int64_t i = 0; i < n[0]; i++, count++)
                v[count] = map_value(kind, (const int64_t[3]){i, j, k}, count);
    sdm_faces faces = {0};
    assert_int_equal(sdm_faces_create(&g, v, &faces, NULL), SDM_OK);
    const int64_t pad = 7;
    for (int64_t k = -pad; k < n[2] + pad; k++)
        for (int64_t j = -pad; j < n[1] + pad; j++)
            for (int64_t i = -pad; i < n[0] + pad; i++) {
                const int64_t p[3] = {i, j, k};
                if (i >= 0 && i < n[0] && j >= 0 && j < n[1] && k >= 0 && k < n[2]) continue;
                for (double most = 0.9; most < 20; most *= 10) {
                    const double found = sdm_faces_distance(&faces, p, most),
                                 wanted = distance_by_search(&g, v, p, most);
                    if (!(fabs(found - wanted) <= 1e-12))
                        fail_msg("kind %d, voxel %d %d %d: %.15g, not %.15g", kind, (int)i, (int)j,
                                 (int)k, found, wanted);
                }
            }
    sdm_faces_dispose(&faces);
    free(v);
}

static void test_values_match_brute_force(void **state)
{
    (void)state;
    for (int kind = 0; kind < 3; kind++) {
        faces_check((const int64_t[3]){9, 8, 11}, kind);
        faces_check((const int64_t[3]){16, 1, 5}, kind);
        faces_check((const int64_t[3]){1, 1, 1}, kind);
    }
}

// Each allocation fails once: an error, and no leak (detected by the sanitizer build).
static void test_each_allocation_may_fail(void **state)
{
    (void)state;
    const int64_t n[3] = {5, 4, 3};
    const double origin[3] = {0, 0, 0};
    const sdm_grid g = sdm_grid_centred(n, VOXEL, origin);
    const float v[60] = {0};
    sdm_status s = SDM_E_NOMEM;
    unsigned long fails = 1;
    for (; s == SDM_E_NOMEM && fails < 100; fails++) {
        sdm_faces faces = {0};
        sdm_alloc_fail_after(fails);
        s = sdm_faces_create(&g, v, &faces, NULL);
        sdm_alloc_fail_after(0);
        sdm_faces_dispose(&faces);
        assert_true(s == SDM_OK || s == SDM_E_NOMEM);
    }
    assert_int_equal(s, SDM_OK);
    assert_true(fails > 12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_values_match_brute_force),
                                       cmocka_unit_test(test_each_allocation_may_fail)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
