/* Warps of the `template` network for every instruction set of the processor: displacements by
 * cubic B-splines, and their inverse at the stations, with the same bits. Tests:
 * template_kernels_avx2.c template_kernels_avx512.c template_kernels_generic.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/rng.h"
#include "template_tables.h"

// Control points and stations along x, y, z.
enum { NX = 6, NY = 5, NZ = 7, CONTROLS = NX * NY * NZ };
enum { LINE = 9, LINES = 6, PLANES = 4, STATIONS = LINE * LINES * PLANES };

static float control[CONTROLS][4];

// A warp with displacements of up to `size` mm.
static template_warp random_warp(double size)
{
    for (size_t i = 0; i < CONTROLS; i++)
        for (size_t c = 0; c < 3; c++)
            control[i][c] = (float)(size * (2 * sdm_rng_uniform(13, c, i) - 1));
    return (template_warp){
        .control = control[0], .n = {NX, NY, NZ}, .origin = {-2, 1, -3}, .spacing = 1.25};
}

// The weight of control point k at the coordinate u of n control points, or its derivative by u.
static double spline_weight(double u, int32_t n, int k, bool slope)
{
    const bool inside = u >= 1 && u <= n - 2;
    const double at = fmin(fmax(u, 1), n - 2), x = fabs(at - k), side = at < k ? -1 : 1;
    if (slope)
        return !inside || x >= 2 ? 0
               : x < 1           ? side * (1.5 * x * x - 2 * x)
                                 : -side * 0.5 * (2 - x) * (2 - x);
    return x >= 2 ? 0 : x < 1 ? 2.0 / 3 - x * x + 0.5 * x * x * x : (2 - x) * (2 - x) * (2 - x) / 6;
}

// u[4][4] = the displacement of the warp at y and its derivatives by x, y, z, from all control
// points.
static void displacement(const template_warp *w, const double y[3], double u[4][4])
{
    memset(u, 0, 16 * sizeof u[0][0]);
    for (int i = 0; i < CONTROLS; i++) {
        const int at[3] = {i % NX, i / NX % NY, i / NX / NY};
        for (int d = 0; d < 4; d++) {
            double weight = d ? 1 / w->spacing : 1;
            for (int a = 0; a < 3; a++)
                weight *=
                    spline_weight((y[a] - w->origin[a]) / w->spacing, w->n[a], at[a], d == a + 1);
            for (int c = 0; c < 4; c++) u[d][c] += weight * (double)control[i][c];
        }
    }
}

static void displacements_are_the_sum_with_the_same_bits(void **state)
{
    (void)state;
    const template_warp w = random_warp(2);
    for (uint64_t i = 0; i < 300; i++) {
        double y[3], expected[4][4];
        float first[4][4] = {{0}};
        for (uint64_t a = 0; a < 3; a++) // within the lattice and beyond its ends
            y[a] = w.origin[a] + w.spacing * (w.n[a] + 3) * sdm_rng_uniform(17, a, i) - 2;
        displacement(&w, y, expected);
        for (size_t t = 0; t < n_tables; t++) {
            template_place place;
            float sum[4][4];
            tables[t]->find_place(&w, y, &place);
            tables[t]->displace(&w, &place, sum);
            if (t == 0) memcpy(first, sum, sizeof sum);
            assert_memory_equal(first, sum, sizeof sum);
        }
        for (int d = 0; d < 4; d++)
            for (int c = 0; c < 4; c++)
                assert_true(fabs((double)first[d][c] - expected[d][c]) <= 1e-5);
    }
}

static void special_points_have_a_place(void **state)
{
    (void)state;
    const template_warp w = random_warp(1);
    static const double special[] = {NAN, INFINITY, -INFINITY, 1e300, -1e300, 0};
    for (size_t i = 0; i < sizeof special / sizeof *special; i++)
        for (size_t t = 0; t < n_tables; t++) {
            template_place place;
            tables[t]->find_place(&w, (const double[]){special[i], special[i], special[i]}, &place);
            assert_true(place.first >= 0 && place.first / 4 + 3 + NX * (3 + NY * 3) < CONTROLS);
        }
}

typedef struct stations {
    float points[STATIONS][4], metric[STATIONS][8];
    template_station station[STATIONS];
} stations;

// The point that station i of line `line` has without the warp.
static void unwarped(size_t i, size_t line, double q[3])
{
    const double at[3] = {(double)i, (double)(line % LINES), (double)(line / LINES)};
    q[0] = -1.5 + 0.6 * at[0] + 0.1 * at[1];
    q[1] = 1.25 + 0.7 * at[1] - 0.05 * at[2];
    q[2] = -2.5 + 0.1 * at[0] + 0.8 * at[2];
}

// The network's order: the first two lines of a plane and the first two planes in turn, up to
// n_lines at once.
static void invert_all(const template_table *t, const template_warp *w, size_t n_lines,
                       bool keep_stations, stations *s)
{
    template_stations all = {.n = LINE,
                             .frame = {1, 0.5, 0, -0.25, 1, 0, 0, 0.125, 2},
                             .origin = {-3, -2, -1},
                             .spacing = 0.5,
                             .line = LINE,
                             .plane = LINE * LINES};
    for (size_t line = 0; line < LINES * PLANES; line += all.n_lines) {
        const size_t y = line % LINES;
        const bool in_turn = y < 2 || line < 2 * LINES;
        const size_t left = line < 2 * LINES ? LINES - y : 2 - y;
        all.n_lines = !in_turn ? 1 : left < n_lines ? left : n_lines;
        for (size_t l = 0; l < all.n_lines; l++) {
            double first[3], second[3];
            unwarped(0, line + l, first);
            unwarped(1, line + l, second);
            for (int c = 0; c < 3; c++)
                all.first[c][l] = first[c], all.step[c][l] = second[c] - first[c];
        }
        all.points = s->points[line * LINE];
        all.metric = s->metric[line * LINE];
        all.station = keep_stations ? s->station + line * LINE : NULL;
        (in_turn ? t->invert_in_turn : t->invert_line)(w, &all);
    }
}

static void inverse_undoes_the_warp_with_the_same_bits(void **state)
{
    (void)state;
    static stations first, other;
    const template_warp w = random_warp(0.3);
    invert_all(tables[0], &w, 4, true, &first);
    for (size_t i = 0; i < STATIONS; i++) {
        const template_station *s = &first.station[i];
        double q[3], u[4][4], b[9];
        unwarped(i % LINE, i / LINE, q);
        displacement(&w, s->y, u);
        for (int c = 0; c < 3; c++) {
            assert_true(fabs(s->y[c] + u[0][c] - q[c]) <= 1e-4);
            assert_true(fabs((double)first.points[i][c] - (s->y[c] - (double)(c - 3)) / 0.5) <=
                        1e-5);
        }
        assert_true(first.points[i][3] == 0);
        // the inverse belongs to the point before the last step
        const double frame[9] = {1, 0.5, 0, -0.25, 1, 0, 0, 0.125, 2};
        for (int r = 0; r < 3; r++)
            for (int c = 0; c < 3; c++) {
                double product = 0;
                b[3 * r + c] = 0;
                for (int k = 0; k < 3; k++) {
                    product += s->inverse[3 * r + k] * ((k == c) + u[1 + c][k]);
                    b[3 * r + c] += s->inverse[3 * r + k] * frame[3 * k + c];
                }
                assert_true(fabs(product - (r == c)) <= 0.02);
            }
        static const int row[6] = {0, 1, 2, 1, 0, 0}, column[6] = {0, 1, 2, 2, 2, 1};
        for (int c = 0; c < 6; c++) {
            double sum = 0;
            for (int k = 0; k < 3; k++) sum += b[3 * row[c] + k] * b[3 * column[c] + k];
            assert_true(fabs((double)first.metric[i][c] - sum) <= 1e-5);
        }
        assert_true(first.metric[i][6] == 0 && first.metric[i][7] == 0);
    }
    for (size_t t = 0; t < n_tables; t++)
        for (size_t n_lines = 1; n_lines <= 4; n_lines++) {
            invert_all(tables[t], &w, n_lines, true, &other);
            assert_memory_equal(&first, &other, sizeof first);
            memset(&other, 0, sizeof other);
            invert_all(tables[t], &w, n_lines, false, &other);
            assert_memory_equal(first.points, other.points, sizeof first.points);
            assert_memory_equal(first.metric, other.metric, sizeof first.metric);
        }
}

static void folds_stay_finite_with_the_same_bits(void **state)
{
    (void)state;
    static stations first, other;
    const template_warp w = random_warp(5);
    invert_all(tables[0], &w, 4, true, &first);
    for (size_t i = 0; i < STATIONS; i++)
        for (int c = 0; c < 3; c++) assert_true(isfinite(first.points[i][c]));
    for (size_t t = 1; t < n_tables; t++) {
        invert_all(tables[t], &w, 4, true, &other);
        assert_memory_equal(&first, &other, sizeof first);
    }
}

int main(void)
{
    find_tables();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(displacements_are_the_sum_with_the_same_bits),
        cmocka_unit_test(special_points_have_a_place),
        cmocka_unit_test(inverse_undoes_the_warp_with_the_same_bits),
        cmocka_unit_test(folds_stay_finite_with_the_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
