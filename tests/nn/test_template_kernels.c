/* Kernels of the `template` network for every instruction set of the processor: the same bits, and
 * the formulas of template_kernels.h in double precision. Inputs have exactly the documented room,
 * so that AddressSanitizer finds reads beyond it. Tests: template_kernels_avx2.c
 * template_kernels_avx512.c template_kernels_generic.c */
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

enum { LENGTH = 40, ROWS = 10 };

static double uniform(uint64_t stream, uint64_t i, double low, double high)
{
    return low + (high - low) * sdm_rng_uniform(7, stream, i);
}

static float *numbers(size_t n, uint64_t stream, double low, double high)
{
    float *v = malloc(n * sizeof *v);
    assert_non_null(v);
    for (size_t i = 0; i < n; i++) v[i] = (float)uniform(stream, i, low, high);
    return v;
}

static size_t round_up(size_t n)
{
    return (n + SDM_TEMPLATE_LANES - 1) / SDM_TEMPLATE_LANES * SDM_TEMPLATE_LANES;
}

// Rows of numbers for n voxels, with room for a multiple of SDM_TEMPLATE_LANES.
typedef struct rows {
    float *row[ROWS];
} rows;

static rows rows_new(size_t n, uint64_t stream, double low, double high)
{
    rows r;
    for (size_t i = 0; i < ROWS; i++) r.row[i] = numbers(round_up(n), stream + i, low, high);
    return r;
}

static void rows_free(rows *r)
{
    for (size_t i = 0; i < ROWS; i++) free(r->row[i]);
}

static const float *const *in(const rows *r) { return (const float *const *)r->row; }

static void same_bits(const rows *a, const rows *b, size_t n_rows, size_t n)
{
    for (size_t i = 0; i < n_rows; i++)
        assert_memory_equal(a->row[i], b->row[i], n * sizeof(float));
}

// Indices inside of a lattice of at most 7 nodes and outside of it, on nodes, and special numbers.
static rows indices(size_t n)
{
    static const float special[] = {NAN, INFINITY, -INFINITY, 1e30f, -1e30f, 0, -0.0f, 1, 3, 6, 7};
    const size_t n_special = sizeof special / sizeof *special;
    rows u = rows_new(n, 100, -3, 10);
    for (size_t a = 0; a < 3; a++)
        for (size_t i = 0; i < n; i++)
            if (sdm_rng_below(7, 200 + a, i, 3) == 0)
                u.row[a][i] = special[sdm_rng_below(7, 300 + a, i, n_special)];
    return u;
}

/* Two lattices: nodes of their own, and a coarser one. */
static const int32_t SIZES[2][3] = {{7, 5, 6}, {2, 4, 3}};
static const float SCALES[2] = {1, 0.4f}, OFFSETS[2][3] = {{0, 0, 0}, {-0.25f, 0.5f, 0.75f}};

static template_level level_new(size_t kind)
{
    const int32_t *n = SIZES[kind];
    template_level l = {.half = 0.75f, .scale = SCALES[kind]};
    memcpy(l.n, n, sizeof l.n);
    memcpy(l.offset, OFFSETS[kind], sizeof l.offset);
    l.nodes = numbers(4 * (size_t)n[0] * (size_t)n[1] * (size_t)n[2], 400, -2, 2);
    return l;
}

static template_correction correction_new(size_t kind)
{
    const int32_t *n = SIZES[kind];
    template_correction c = {.scale = SCALES[kind]};
    memcpy(c.n, n, sizeof c.n);
    memcpy(c.offset, OFFSETS[kind], sizeof c.offset);
    c.map = numbers((size_t)n[0] * (size_t)n[1] * (size_t)n[2], 500, -2, 2);
    return c;
}

// The eight nodes of the cell of a point and their trilinear weights.
typedef struct cell {
    size_t node[8];
    double weight[8], t[3];
} cell;

static cell cell_of(const int32_t n[3], float scale, const float offset[3], const rows *u, size_t i)
{
    cell c;
    size_t first[3];
    for (size_t a = 0; a < 3; a++) {
        // the index is rounded to single precision, as in the kernels
        const float scaled = u->row[a][i] * scale, index = scaled + offset[a];
        double x = isnan(index) ? 0 : (double)index;
        x = fmin(fmax(x, 0), n[a] - 1);
        first[a] = (size_t)fmin(floor(x), n[a] - 2);
        c.t[a] = x - (double)first[a];
    }
    for (size_t k = 0; k < 8; k++) {
        const size_t at[3] = {first[0] + (k & 1), first[1] + (k >> 1 & 1), first[2] + (k >> 2)};
        c.node[k] = (at[2] * (size_t)n[1] + at[1]) * (size_t)n[0] + at[0];
        c.weight[k] = 1;
        for (size_t a = 0; a < 3; a++) c.weight[k] *= k >> a & 1 ? c.t[a] : 1 - c.t[a];
    }
    return c;
}

// out[4] = distance and gradient
static void lookup_plainly(const template_level *l, const rows *u, size_t i, double out[4])
{
    const cell c = cell_of(l->n, l->scale, l->offset, u, i);
    for (size_t a = 0; a < 4; a++) {
        out[a] = 0;
        for (size_t k = 0; k < 8; k++) out[a] += c.weight[k] * (double)l->nodes[4 * c.node[k] + a];
    }
    for (size_t a = 0; a < 3; a++) {
        // change of the derivative along axis a, interpolated along the other two
        double change = 0;
        for (size_t k = 0; k < 8; k++)
            if (k >> a & 1)
                change += (c.weight[k] + c.weight[k ^ 1u << a]) *
                          ((double)l->nodes[4 * c.node[k] + 1 + a] -
                           (double)l->nodes[4 * c.node[k ^ 1u << a] + 1 + a]);
        out[0] -= (double)l->half * c.t[a] * (1 - c.t[a]) * change;
    }
}

static void lookup_is_the_formula_with_the_same_bits(void **state)
{
    (void)state;
    for (size_t kind = 0; kind < 2; kind++)
        for (size_t n = 1; n <= LENGTH; n++) {
            const template_level l = level_new(kind);
            rows u = indices(n), first = rows_new(n, 600, 0, 1);
            tables[0]->lookup(&l, n, in(&u), first.row[0], first.row + 1);
            for (size_t i = 0; i < n; i++) {
                double expected[4];
                lookup_plainly(&l, &u, i, expected);
                for (size_t a = 0; a < 4; a++)
                    assert_true(fabs((double)first.row[a][i] - expected[a]) <= 4e-6);
            }
            for (size_t t = 1; t < n_tables; t++) {
                rows other = rows_new(n, 700, 0, 1);
                tables[t]->lookup(&l, n, in(&u), other.row[0], other.row + 1);
                same_bits(&first, &other, 4, n);
                rows_free(&other);
            }
            rows_free(&u);
            rows_free(&first);
            free((void *)(uintptr_t)l.nodes);
        }
}

// A quadratic function and its gradient at a point in mm.
static double quadratic(const double x[3], double g[3])
{
    g[0] = 0.3 + 0.8 * x[0] - 0.5 * x[1];
    g[1] = -0.7 - 0.5 * x[0] + 0.6 * x[1] + 0.4 * x[2];
    g[2] = 0.2 + 0.4 * x[1] - 0.9 * x[2];
    return 1.5 + 0.3 * x[0] - 0.7 * x[1] + 0.2 * x[2] + 0.4 * x[0] * x[0] + 0.3 * x[1] * x[1] -
           0.45 * x[2] * x[2] - 0.5 * x[0] * x[1] + 0.4 * x[1] * x[2];
}

static void lookup_reproduces_quadratic_functions(void **state)
{
    (void)state;
    template_level l = level_new(0);
    float *nodes = (float *)(uintptr_t)l.nodes;
    const double spacing = 2 * (double)l.half;
    for (int z = 0, k = 0; z < l.n[2]; z++)
        for (int y = 0; y < l.n[1]; y++)
            for (int x = 0; x < l.n[0]; x++, k++) {
                double g[3];
                nodes[4 * k] =
                    (float)quadratic((const double[3]){spacing * x, spacing * y, spacing * z}, g);
                for (int a = 0; a < 3; a++) nodes[4 * k + 1 + a] = (float)g[a];
            }
    rows u = rows_new(LENGTH, 800, 0, 4), out = rows_new(LENGTH, 900, 0, 1);
    for (size_t t = 0; t < n_tables; t++) {
        tables[t]->lookup(&l, LENGTH, in(&u), out.row[0], out.row + 1);
        for (size_t i = 0; i < LENGTH; i++) {
            double g[3];
            const double x[3] = {spacing * (double)u.row[0][i], spacing * (double)u.row[1][i],
                                 spacing * (double)u.row[2][i]};
            assert_true(fabs((double)out.row[0][i] - quadratic(x, g)) <= 2e-5);
            for (size_t a = 0; a < 3; a++)
                assert_true(fabs((double)out.row[1 + a][i] - g[a]) <= 1e-5);
        }
    }
    rows_free(&u);
    rows_free(&out);
    free(nodes);
}

static void correct_is_trilinear_with_the_same_bits(void **state)
{
    (void)state;
    for (size_t kind = 0; kind < 2; kind++)
        for (size_t n = 1; n <= LENGTH; n++) {
            const template_correction c = correction_new(kind);
            rows u = indices(n), first = rows_new(n, 600, 0, 1), before = rows_new(n, 600, 0, 1);
            tables[0]->correct(&c, n, in(&u), first.row[0]);
            for (size_t i = 0; i < n; i++) {
                const cell at = cell_of(c.n, c.scale, c.offset, &u, i);
                double expected = (double)before.row[0][i];
                for (size_t k = 0; k < 8; k++) expected += at.weight[k] * (double)c.map[at.node[k]];
                assert_true(fabs((double)first.row[0][i] - expected) <= 2e-6);
            }
            for (size_t t = 1; t < n_tables; t++) {
                rows other = rows_new(n, 600, 0, 1);
                tables[t]->correct(&c, n, in(&u), other.row[0]);
                same_bits(&first, &other, 1, n);
                rows_free(&other);
            }
            rows_free(&u);
            rows_free(&first);
            rows_free(&before);
            free((void *)(uintptr_t)c.map);
        }
}

static void normalise_is_the_formula_with_the_same_bits(void **state)
{
    (void)state;
    for (size_t n = 1; n <= LENGTH; n++) {
        rows r = rows_new(n, 1000, -0.3, 0.3); // f, g[3], metric[6]
        for (size_t a = 4; a < 7; a++)
            for (size_t i = 0; i < n; i++) r.row[a][i] += 1.5f; // positive definite
        rows first = rows_new(n, 1100, 0, 1);
        tables[0]->normalise(n, r.row[0], in(&r) + 1, in(&r) + 4, first.row[0]);
        for (size_t i = 0; i < n; i++) {
            double v[ROWS];
            for (size_t a = 0; a < ROWS; a++) v[a] = (double)r.row[a][i];
            const double G[3][3] = {{v[4], v[9], v[8]}, {v[9], v[5], v[7]}, {v[8], v[7], v[6]}};
            const double e = 1e-3, trace = (G[0][0] + G[1][1] + G[2][2]) / 3;
            double above = e * trace, below = e;
            for (size_t a = 0; a < 3; a++) {
                below += v[1 + a] * v[1 + a];
                for (size_t b = 0; b < 3; b++) above += v[1 + a] * G[a][b] * v[1 + b];
            }
            assert_true(fabs((double)first.row[0][i] - v[0] / sqrt(above / below)) <= 3e-7);
        }
        for (size_t t = 1; t < n_tables; t++) {
            rows other = rows_new(n, 1000, -0.3, 0.3); // row 0 = f: out may be f
            tables[t]->normalise(n, other.row[0], in(&r) + 1, in(&r) + 4, other.row[0]);
            same_bits(&first, &other, 1, n);
            rows_free(&other);
        }
        rows_free(&r);
        rows_free(&first);
    }
}

// The B-spline of a degree over the knots 0, 1, .. (Cox and de Boor).
static double spline(int degree, double x)
{
    if (degree == 0) return x >= 0 && x < 1;
    return (x * spline(degree - 1, x) + (degree + 1 - x) * spline(degree - 1, x - 1)) / degree;
}

static template_expansion expansion_new(void)
{
    template_expansion e;
    for (int i = 0; i < 4; i++) {
        for (int k = 0; k < 4; k++) e.cubic[k][i] = (float)spline(3, 3 - k + 0.25 * i);
        e.linear[i] = 0.25f * (float)i;
    }
    return e;
}

// Component c of voxel i of a line: splines of its stations.
static double expand_plainly(const float *points, const float *metric, size_t c, size_t i)
{
    const double x = 0.25 * (double)i;
    double sum = 0;
    for (size_t k = 0; k < 4 && c < 3; k++) // station k lies at x = k - 1
        sum += spline(3, x - (double)k + 3) * (double)points[4 * k + c];
    for (size_t k = 0; k < 2 && c >= 3; k++) sum += (k ? x : 1 - x) * (double)metric[8 * k + c - 3];
    return sum;
}

static void expand_makes_splines_with_the_same_bits(void **state)
{
    (void)state;
    const template_expansion e = expansion_new();
    const size_t stride = 19; // of 16 lines with four stations each
    float *points = numbers(15 * stride + 16, 1200, -2, 2),
          *metric = numbers(15 * stride + 16, 1300, -2, 2);
    for (size_t n_c = 3; n_c <= 9; n_c += 6) {
        rows first = rows_new(64, 1400, 0, 1);
        tables[0]->expand(&e, points, metric, stride, n_c, first.row);
        for (size_t c = 0; c < n_c; c++)
            for (size_t i = 0; i < 64; i++)
                assert_true(fabs((double)first.row[c][i] - expand_plainly(points + i / 4 * stride,
                                                                          metric + i / 4 * stride,
                                                                          c, i % 4)) <= 1e-6);
        for (size_t t = 1; t < n_tables; t++) {
            rows other = rows_new(64, 1500, 0, 1);
            tables[t]->expand(&e, points, metric, stride, n_c, other.row);
            same_bits(&first, &other, n_c, 64);
            rows_free(&other);
        }
        rows_free(&first);
    }
    free(points);
    free(metric);
}

// A function with third powers and its gradient; the sum of products of linear functions in two
// variables and of cubic ones in the third.
static double cubic(const double x[3], double g[3])
{
    const double value = quadratic(x, g);
    g[0] += 0.6 * x[0] * x[0] * (1 + 0.5 * x[1] * x[2]);
    g[1] += -0.3 * x[1] * x[1] + 0.1 * x[0] * x[0] * x[0] * x[2];
    g[2] += 0.9 * x[2] * x[2] + 0.1 * x[0] * x[0] * x[0] * x[1];
    return value + 0.2 * x[0] * x[0] * x[0] * (1 + 0.5 * x[1] * x[2]) - 0.1 * x[1] * x[1] * x[1] +
           0.3 * x[2] * x[2] * x[2];
}

static void block_reproduces_cubic_functions_with_the_same_bits(void **state)
{
    (void)state;
    enum { LINE = 12, PLANE = 40 }; // floats; the corners of the block, with gaps
    float corner[PLANE + LINE + 8], first[64];
    for (size_t i = 0; i < sizeof corner / sizeof *corner; i++) corner[i] = NAN;
    for (int k = 0; k < 8; k++) {
        const double x[3] = {k & 1, k >> 1 & 1, k >> 2};
        double g[3];
        float *at = corner + (k & 1) * 4 + (k >> 1 & 1) * LINE + (k >> 2) * PLANE;
        at[0] = (float)cubic(x, g);
        for (int a = 0; a < 3; a++) at[1 + a] = (float)g[a];
    }
    tables[0]->block(corner, LINE, PLANE, first);
    for (int i = 0; i < 64; i++) {
        const double x[3] = {0.25 * (i % 4), 0.25 * (i / 4 % 4), 0.25 * (i / 16)};
        double g[3];
        assert_true(fabs((double)first[i] - cubic(x, g)) <= 2e-6);
    }
    for (size_t t = 1; t < n_tables; t++) {
        float other[64];
        tables[t]->block(corner, LINE, PLANE, other);
        assert_memory_equal(first, other, sizeof first);
    }
    for (int k = 0; k < 8; k++) { // a corner that is not a number shows in the first value
        float *at = corner + (k & 1) * 4 + (k >> 1 & 1) * LINE + (k >> 2) * PLANE;
        const float value = at[0];
        at[0] = NAN;
        for (size_t t = 0; t < n_tables; t++) {
            tables[t]->block(corner, LINE, PLANE, first);
            assert_true(isnan(first[0]));
        }
        at[0] = value;
    }
}

static void block_returns_the_smallest_magnitude(void **state)
{
    (void)state;
    enum { LINE = 8, PLANE = 16, BLOCKS = 200 };
    bool seen[64] = {false}; // the voxels in which it was
    size_t n_seen = 0;
    for (size_t i = 0; i < BLOCKS; i++) {
        float *corner = numbers(32, 1900 + i, -1, 1), value[64];
        for (size_t t = 0; t < n_tables; t++) {
            const float least = tables[t]->block(corner, LINE, PLANE, value);
            size_t at = 0;
            for (size_t v = 1; v < 64; v++)
                if (fabsf(value[v]) < fabsf(value[at])) at = v;
            assert_true(least == fabsf(value[at]));
            n_seen += !seen[at], seen[at] = true;
        }
        free(corner);
    }
    assert_true(n_seen > 48);
}

static void separate_makes_columns(void **state)
{
    (void)state;
    for (size_t n = 1; n <= LENGTH; n++)
        for (size_t t = 0; t < n_tables; t++)
            for (size_t stride = 4; stride <= 8; stride += 4) {
                float *from = numbers(n * stride, 1600, -2, 2);
                const size_t room = n + SDM_TEMPLATE_LANES;
                rows to = rows_new(room, 1700, 0, 1), before = rows_new(room, 1700, 0, 1);
                tables[t]->separate(n, from, stride, to.row);
                for (size_t c = 0; c < 4; c++) {
                    for (size_t i = 0; i < n; i++)
                        assert_true(to.row[c][i] == from[i * stride + c]);
                    // nothing beyond the end is written
                    assert_memory_equal(to.row[c] + n, before.row[c] + n,
                                        SDM_TEMPLATE_LANES * sizeof *from);
                }
                rows_free(&to);
                rows_free(&before);
                free(from);
            }
}

// The distance d = f s + r at station i, and its gradient along axis a.
static double corner_plainly(const rows *r, size_t i, size_t stride, double spacing, bool slope)
{
    double at[ROWS], change[ROWS];
    for (size_t k = 0; k < 9; k++) {
        at[k] = (double)r->row[k][i];
        change[k] = ((double)r->row[k][i + stride] - (double)r->row[k][i - stride]) / 2;
    }
    if (!slope) return at[0] * at[4] + at[5];
    double by_u = 0;
    for (size_t c = 0; c < 3; c++) by_u += at[1 + c] * change[6 + c];
    return at[4] * spacing * by_u + at[0] * change[4] + change[5];
}

static void corners_are_central_differences_with_the_same_bits(void **state)
{
    (void)state;
    const size_t stride[3] = {1, 5, 13};
    for (size_t n = 1; n <= LENGTH; n++) {
        rows r = rows_new(n + 2 * stride[2] + SDM_TEMPLATE_LANES - 1, 1800, -1, 1);
        const template_samples samples = {.f = r.row[0],
                                          .g = {r.row[1], r.row[2], r.row[3]},
                                          .s = r.row[4],
                                          .r = r.row[5],
                                          .u = {r.row[6], r.row[7], r.row[8]}};
        float *first = calloc(4 * n, sizeof *first), *other = calloc(4 * n, sizeof *other);
        assert_true(first && other);
        tables[0]->corners(&samples, stride[2], n, stride, 0.3f, first);
        for (size_t i = 0; i < n; i++)
            for (size_t k = 0; k < 4; k++)
                assert_true(fabs((double)first[4 * i + k] - corner_plainly(&r, stride[2] + i,
                                                                           k ? stride[k - 1] : 1,
                                                                           0.3, k > 0)) <= 1e-6);
        for (size_t t = 1; t < n_tables; t++) {
            tables[t]->corners(&samples, stride[2], n, stride, 0.3f, other);
            assert_memory_equal(first, other, 4 * n * sizeof *first);
        }
        free(first);
        free(other);
        rows_free(&r);
    }
}

int main(void)
{
    find_tables();
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(lookup_is_the_formula_with_the_same_bits),
        cmocka_unit_test(lookup_reproduces_quadratic_functions),
        cmocka_unit_test(correct_is_trilinear_with_the_same_bits),
        cmocka_unit_test(normalise_is_the_formula_with_the_same_bits),
        cmocka_unit_test(expand_makes_splines_with_the_same_bits),
        cmocka_unit_test(block_reproduces_cubic_functions_with_the_same_bits),
        cmocka_unit_test(block_returns_the_smallest_magnitude),
        cmocka_unit_test(separate_makes_columns),
        cmocka_unit_test(corners_are_central_differences_with_the_same_bits),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
