/* Kernels of the `template` network for derivatives, and for the choice of parts and blocks: the
 * same bits for every instruction set of the processor, derivatives against differences of the
 * functions themselves.
 * Tests: template_kernels_avx2.c template_kernels_avx512.c template_kernels_generic.c */
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

// N points; rows have room for whole vectors.
enum { N = 37, ROOM = 64, NX = 6, NY = 5, NZ = 7, SLOPE_ROWS = 29 };

static float uniform(uint64_t stream, uint64_t i, double low, double high)
{
    return (float)(low + (high - low) * sdm_rng_uniform(11, stream, i));
}

static void assert_near(double value, double expected, double tolerance)
{
    assert_true(fabs(value - expected) <= tolerance);
}

static void fill(float *v, size_t n, uint64_t stream, double low, double high)
{
    for (size_t i = 0; i < n; i++) v[i] = uniform(stream, i, low, high);
}

// All rows of derivatives, in the order of the fields.
typedef struct slope_rows {
    float row[SLOPE_ROWS][ROOM];
    template_slope_rows at;
} slope_rows;

static slope_rows *slope_rows_new(void)
{
    slope_rows *s = calloc(1, sizeof *s);
    assert_non_null(s);
    size_t n = 0;
    s->at.f = s->row[n++];
    for (int a = 0; a < 3; a++) s->at.g[a] = s->row[n++];
    for (int a = 0; a < 3; a++) s->at.df[a] = s->row[n++];
    for (int a = 0; a < 9; a++) s->at.dg[a / 3][a % 3] = s->row[n++];
    s->at.factor = s->row[n++];
    for (int a = 0; a < 3; a++) s->at.by_u[a] = s->row[n++];
    for (int a = 0; a < 6; a++) s->at.by_metric[a] = s->row[n++];
    for (int a = 0; a < 3; a++) s->at.dr[a] = s->row[n++];
    assert_int_equal(n, SLOPE_ROWS);
    return s;
}

/* Points well within cells of a lattice of NX x NY x NZ nodes, and beyond its ends. */
static void place_points(float (*u)[ROOM], float scale, const float offset[3])
{
    static const int nodes[3] = {NX, NY, NZ};
    for (size_t a = 0; a < 3; a++)
        for (size_t i = 0; i < ROOM; i++) {
            const double cell = (double)sdm_rng_below(11, a, i, (uint64_t)nodes[a] + 1) - 1;
            u[a][i] = (float)((cell + (double)uniform(3 + a, i, 0.2, 0.8) - (double)offset[a]) /
                              (double)scale);
        }
}

static const float OFFSET[3] = {0.5f, -0.25f, 1};
static const float STEP = 0.0625f;

static void lookup_has_these_slopes(void **state)
{
    (void)state;
    static float nodes[NX * NY * NZ][4], u[3][ROOM], moved[ROOM], f[2][ROOM], g[2][3][ROOM];
    fill(nodes[0], 4 * NX * NY * NZ, 20, -2, 2);
    const template_level l = {.nodes = nodes[0],
                              .n = {NX, NY, NZ},
                              .half = 0.75f,
                              .scale = 0.5f,
                              .offset = {OFFSET[0], OFFSET[1], OFFSET[2]}};
    place_points(u, l.scale, OFFSET);
    const float *const at[3] = {u[0], u[1], u[2]};
    slope_rows *first = slope_rows_new();
    tables[0]->lookup_slopes(&l, N, at, &first->at);
    float *const gradient[2][3] = {{g[0][0], g[0][1], g[0][2]}, {g[1][0], g[1][1], g[1][2]}};
    tables[0]->lookup(&l, N, at, f[0], gradient[0]);
    for (size_t i = 0; i < N; i++) {
        assert_near((double)first->at.f[i], (double)f[0][i], 3e-6);
        for (int a = 0; a < 3; a++)
            assert_near((double)first->at.g[a][i], (double)g[0][a][i], 3e-6);
    }
    // quadratic along every axis within a cell: central differences are exact
    for (int a = 0; a < 3; a++) {
        for (int side = 0; side < 2; side++) {
            const float *shifted[3] = {u[0], u[1], u[2]};
            for (size_t i = 0; i < ROOM; i++) moved[i] = u[a][i] + (side ? STEP : -STEP);
            shifted[a] = moved;
            tables[0]->lookup(&l, N, shifted, f[side], gradient[side]);
        }
        for (size_t i = 0; i < N; i++) {
            const float per = 0.5f / STEP;
            assert_near((double)first->at.df[a][i], (double)(per * (f[1][i] - f[0][i])), 2e-5);
            for (int b = 0; b < 3; b++)
                assert_near((double)first->at.dg[a][b][i],
                            (double)(per * (g[1][b][i] - g[0][b][i])), 2e-5);
        }
    }
    for (size_t t = 1; t < n_tables; t++) {
        slope_rows *other = slope_rows_new();
        tables[t]->lookup_slopes(&l, N, at, &other->at);
        for (int row = 0; row < 16; row++)
            assert_memory_equal(first->row[row], other->row[row], N * sizeof(float));
        free(other);
    }
    free(first);
}

static void correction_has_these_slopes(void **state)
{
    (void)state;
    static float map[NX * NY * NZ], u[3][ROOM], moved[ROOM], value[2][ROOM];
    fill(map, NX * NY * NZ, 30, -2, 2);
    const template_correction c = {
        .map = map, .n = {NX, NY, NZ}, .scale = 0.5f, .offset = {OFFSET[0], OFFSET[1], OFFSET[2]}};
    place_points(u, c.scale, OFFSET);
    const float *const at[3] = {u[0], u[1], u[2]};
    slope_rows *first = slope_rows_new();
    tables[0]->correct_slopes(&c, N, at, first->at.dr);
    for (int a = 0; a < 3; a++) {
        for (int side = 0; side < 2; side++) {
            const float *shifted[3] = {u[0], u[1], u[2]};
            for (size_t i = 0; i < ROOM; i++) moved[i] = u[a][i] + (side ? STEP : -STEP);
            shifted[a] = moved;
            memset(value[side], 0, sizeof value[side]);
            tables[0]->correct(&c, N, shifted, value[side]);
        }
        for (size_t i = 0; i < N; i++)
            assert_near((double)first->at.dr[a][i],
                        (double)(0.5f / STEP * (value[1][i] - value[0][i])), 2e-5);
    }
    for (size_t t = 1; t < n_tables; t++) {
        slope_rows *other = slope_rows_new();
        tables[t]->correct_slopes(&c, N, at, other->at.dr);
        for (int a = 0; a < 3; a++)
            assert_memory_equal(first->at.dr[a], other->at.dr[a], N * sizeof(float));
        free(other);
    }
    free(first);
}

// The factor of the metric G = (xx, yy, zz, yz, xz, xy) for the gradient g.
static double factor_of(const double g[3], const double G[6])
{
    const double e = 1e-3;
    const double above = g[0] * g[0] + g[1] * g[1] + g[2] * g[2] + e,
                 below = G[0] * g[0] * g[0] + G[1] * g[1] * g[1] + G[2] * g[2] * g[2] +
                         2 * (G[3] * g[1] * g[2] + G[4] * g[0] * g[2] + G[5] * g[0] * g[1]) +
                         e * (G[0] + G[1] + G[2]) / 3;
    return sqrt(above / below);
}

static void factor_has_these_slopes(void **state)
{
    (void)state;
    static float metric[6][ROOM];
    const double h = 1e-5;
    for (size_t a = 0; a < 6; a++)
        fill(metric[a], ROOM, 40 + a, a < 3 ? 0.8 : -0.2, a < 3 ? 1.3 : 0.2);
    const float *const rows[6] = {metric[0], metric[1], metric[2], metric[3], metric[4], metric[5]};
    slope_rows *first = NULL;
    for (size_t t = 0; t < n_tables; t++) {
        slope_rows *s = slope_rows_new();
        for (size_t row = 1; row < 16; row++) fill(s->row[row], ROOM, 50 + row, -1, 1);
        tables[t]->factor_slopes(N, rows, &s->at);
        for (int row = 16; row < 26 && first; row++)
            assert_memory_equal(first->row[row], s->row[row], N * sizeof(float));
        if (first)
            free(s);
        else
            first = s;
    }
    const template_slope_rows *r = &first->at;
    for (size_t i = 0; i < N; i++) {
        double g[3], G[6], by_g[3];
        for (int a = 0; a < 3; a++) g[a] = (double)r->g[a][i];
        for (int a = 0; a < 6; a++) G[a] = (double)metric[a][i];
        assert_near((double)r->factor[i], factor_of(g, G), 1e-6);
        for (int a = 0; a < 3; a++) {
            double up[3] = {g[0], g[1], g[2]}, down[3] = {g[0], g[1], g[2]};
            up[a] += h, down[a] -= h;
            by_g[a] = (factor_of(up, G) - factor_of(down, G)) / (2 * h);
        }
        for (int a = 0; a < 3; a++) {
            double by_u = 0;
            for (int b = 0; b < 3; b++) by_u += by_g[b] * (double)r->dg[a][b][i];
            assert_near((double)r->by_u[a][i], by_u, 1e-5);
        }
        for (int a = 0; a < 6; a++) {
            double up[6], down[6];
            memcpy(up, G, sizeof G), memcpy(down, G, sizeof G);
            up[a] += h, down[a] -= h;
            assert_near((double)r->by_metric[a][i],
                        (factor_of(g, up) - factor_of(g, down)) / (2 * h), 1e-5);
        }
    }
    free(first);
}

static void sums_and_choices_are_the_formulas(void **state)
{
    (void)state;
    static float a[9][64], b[9][64], sum[64], other[64];
    for (size_t k = 0; k < 9; k++) fill(a[k], 64, 70 + k, -1, 1), fill(b[k], 64, 80 + k, -1, 1);
    const float *pa[9], *pb[9];
    for (int k = 0; k < 9; k++) pa[k] = a[k], pb[k] = b[k];
    for (size_t n = 1; n <= 9; n++) {
        tables[0]->sum_products(n, pa, pb, sum);
        for (size_t v = 0; v < 64; v++) {
            double expected = 0;
            for (size_t k = 0; k < n; k++) expected += (double)a[k][v] * (double)b[k][v];
            assert_near((double)sum[v], expected, 1e-6);
        }
        for (size_t t = 1; t < n_tables; t++) {
            tables[t]->sum_products(n, pa, pb, other);
            assert_memory_equal(sum, other, sizeof sum);
        }
    }
    const float slope[3] = {0.5f, -0.25f, 0.125f};
    for (size_t t = 0; t < n_tables; t++) {
        float lesser[64], plane[64], largest = -INFINITY;
        memcpy(lesser, b[0], sizeof lesser);
        lesser[5] = 0.25f;
        const float first = a[0][5];
        a[0][5] = NAN;
        tables[t]->take_lesser(a[0], lesser);
        a[0][5] = first;
        for (size_t v = 0; v < 64; v++)
            assert_true(lesser[v] == (v == 5 ? 0.25f : fminf(a[0][v], b[0][v])));
        for (size_t v = 0; v < 64; v++) {
            plane[v] = 0.1f + (slope[0] * (float)(v % 4) +
                               (slope[1] * (float)(v / 4 % 4) + slope[2] * (float)(v / 16)));
            largest = fmaxf(largest, b[0][v] - plane[v]);
        }
        assert_true(tables[t]->is_above(0.1f + 1.001f * largest, slope, b[0]));
        assert_false(tables[t]->is_above(0.1f + 0.999f * largest, slope, b[0]));
        for (size_t v = 0; v < 64; v++) { // wherever a voxel is not below
            float values[64];
            for (size_t i = 0; i < 64; i++) values[i] = plane[i] - (i == v ? 0.0f : 0.5f);
            assert_false(tables[t]->is_above(0.1f, slope, values));
        }
    }
}

static void lines_and_tangents_are_the_formulas(void **state)
{
    (void)state;
    enum { POINTS = 21 };
    static float rows[4][ROOM], line[ROOM], out[7 * POINTS], other[7 * POINTS];
    const float by[3][3] = {{1, -0.5f, 0.25f}, {0.75f, 2, -1}, {-0.125f, 0.5f, 3}};
    for (size_t k = 0; k < 4; k++) fill(rows[k], ROOM, 60 + k, -1, 1);
    const float *const g[3] = {rows[1], rows[2], rows[3]};
    for (size_t t = 0; t < n_tables; t++) {
        for (size_t n = 1; n <= POINTS; n++) {
            tables[t]->line(n, 0.1, -0.3, line);
            for (size_t i = 0; i < n; i++) assert_true(line[i] == (float)(0.1 + -0.3 * (double)i));
        }
        memset(out, 0, sizeof out);
        tables[t]->tangents(POINTS, rows[0], g, by, 7, out);
        for (size_t i = 0; i < POINTS; i++) {
            assert_true(out[7 * i] == rows[0][i]);
            for (size_t a = 0; a < 3; a++) {
                double expected = 0;
                for (size_t b = 0; b < 3; b++) expected += (double)by[a][b] * (double)g[b][i];
                assert_near((double)out[7 * i + 1 + a], expected, 1e-6);
            }
            for (size_t k = 4; k < 7; k++) assert_true(out[7 * i + k] == 0);
        }
        if (t == 0) memcpy(other, out, sizeof other);
        assert_memory_equal(out, other, sizeof other);
    }
}

static void layers_are_combined(void **state)
{
    (void)state;
    static float points[4 * 4 * N], metric[2 * 8 * N], out[12 * N], other[12 * N];
    template_expansion e;
    fill(points, 16 * N, 90, -3, 3), fill(metric, 16 * N, 91, -3, 3);
    for (size_t a = 0; a < 4; a++) fill(e.cubic[a], 4, 92 + a, 0, 1);
    fill(e.linear, 4, 96, 0, 1);
    for (size_t phase = 0; phase < 4; phase++) {
        tables[0]->combine(&e, points, metric, N, phase, out);
        for (size_t i = 0; i < 12 * N; i++) {
            double expected = 0;
            if (i < 4 * N) {
                for (size_t k = 0; k < 4; k++)
                    expected += (double)e.cubic[k][phase] * (double)points[4 * N * k + i];
            } else {
                const double t = (double)e.linear[phase];
                const size_t j = i - 4 * N;
                expected = (1 - t) * (double)metric[j] + t * (double)metric[8 * N + j];
            }
            assert_near((double)out[i], expected, 3e-6);
        }
        for (size_t t = 1; t < n_tables; t++) {
            tables[t]->combine(&e, points, metric, N, phase, other);
            assert_memory_equal(out, other, sizeof out);
        }
    }
}

int main(void)
{
    find_tables();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lookup_has_these_slopes),
        cmocka_unit_test(correction_has_these_slopes),
        cmocka_unit_test(factor_has_these_slopes),
        cmocka_unit_test(sums_and_choices_are_the_formulas),
        cmocka_unit_test(lines_and_tangents_are_the_formulas),
        cmocka_unit_test(layers_are_combined),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
