/* Fields of models on grids, at points and as bands, against splines that are solved and evaluated
 * in double precision by other formulas.
 * Tests: field.c field_band.c field_grid.c field_points.c generate_field.c spline.c spline_grid.c
 * spline_kernels_generic.c spline_kernels_avx2.c spline_kernels_avx512.c spline_native.c
 * spline_change.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "runtime/ball_model.h"
#include "sdm/field.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/rng.h"

enum { SEED = 5 };

static const double params[2] = {1.31, 0.4};

static double ripple(const double x[3]) { return 1 + 0.4 * sin(3 * x[0]) * cos(2 * x[1] + x[2]); }

/* A turned orthonormal matrix. */
static void turn(double angle, double dir[9])
{
    const double c = cos(angle), s = sin(angle), r = 0.6, q = 0.8;
    const double d[9] = {c, -s * r, s * q, s, c * r, -c * q, 0, q, r};
    memcpy(dir, d, sizeof d);
}

static sdm_grid grid_of(const int64_t n[3], const double spacing[3], double angle)
{
    sdm_grid g = {.n = {n[0], n[1], n[2]}, .dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    if (angle != 0) turn(angle, g.dir);
    double half[3], middle[3];
    memcpy(g.spacing, spacing, sizeof g.spacing);
    for (int a = 0; a < 3; a++) half[a] = 0.5 * (double)(n[a] - 1);
    sdm_grid_world(&g, half, middle);
    for (int a = 0; a < 3; a++) g.origin[a] -= middle[a];
    return g;
}

/* The models: straight axes, and turned axes. */
static sdm_grid model_grid(bool turned)
{
    return grid_of((const int64_t[]){17, 12, 14}, (const double[]){0.25, 0.31, 0.28},
                   turned ? 0.7 : 0);
}

// ---- the oracle

/* beta(x) = sum over k of (-1)^k binomial(4, k) max(x + 2 - k, 0)^3 / 6, and its derivative
   (Schoenberg 1946). */
static double beta(double x, bool slope)
{
    static const double sign[5] = {1, -4, 6, -4, 1};
    double sum = 0;
    for (int k = 0; k < 5; k++) {
        const double u = fmax(x + 2 - k, 0);
        sum += slope ? sign[k] * 3 * u * u / 6 : sign[k] * u * u * u / 6;
    }
    return fabs(x) < 2 ? sum : 0;
}

/* Weight of coefficient i of an axis of n voxels at index x: coefficients beyond the ends continue
   the others with a third (n = 2: second, n = 1: first) difference of zero. */
static double weight(int64_t n, int64_t i, double x, bool slope)
{
    double w = beta(x - (double)i, slope);
    static const double rule[4][3] = {{0, 0, 0}, {1, 0, 0}, {2, -1, 0}, {3, -3, 1}};
    const double *r = rule[n < 3 ? n : 3];
    if (n == 1) return slope ? 0 : 1;
    if (i < 3) w += r[i] * beta(x + 1, slope);
    if (n - 1 - i < 3) w += r[n - 1 - i] * beta(x - (double)n, slope);
    return w;
}

/* Solves for the coefficients along axis a, by Gaussian elimination with pivots. */
static void solve_axis(const int64_t n[3], int a, double *c)
{
    static double m[32][33];
    const int64_t size = n[a], step = a == 0 ? 1 : a == 1 ? n[0] : n[0] * n[1];
    const int64_t all = n[0] * n[1] * n[2];
    for (int64_t first = 0; first < all; first++) {
        if (first / step % size) continue;
        for (int64_t i = 0; i < size; i++) {
            for (int64_t k = 0; k < size; k++) m[i][k] = weight(size, k, (double)i, false);
            m[i][size] = c[first + i * step];
        }
        for (int64_t i = 0; i < size; i++) {
            int64_t pivot = i;
            for (int64_t k = i; k < size; k++)
                if (fabs(m[k][i]) > fabs(m[pivot][i])) pivot = k;
            for (int64_t k = 0; k <= size; k++) {
                const double t = m[i][k];
                m[i][k] = m[pivot][k], m[pivot][k] = t;
            }
            for (int64_t k = 0; k < size; k++) {
                const double f = k == i ? 0 : m[k][i] / m[i][i];
                for (int64_t q = 0; q <= size; q++) m[k][q] -= f * m[i][q];
            }
        }
        for (int64_t i = 0; i < size; i++) c[first + i * step] = m[i][size] / m[i][i];
    }
}

typedef struct oracle {
    sdm_grid grid;
    double c[BALL_VOXELS];
} oracle;

static void oracle_fit(const sdm_grid *g, const float *values, oracle *o)
{
    o->grid = *g;
    for (size_t i = 0; i < sdm_grid_count(g); i++) o->c[i] = (double)values[i];
    for (int a = 0; a < 3; a++) solve_axis(g->n, a, o->c);
}

/* The spline at x; gradient (NULL: not wanted) by the world coordinates. */
static double oracle_at(const oracle *o, const double x[3], double *gradient)
{
    const int64_t *n = o->grid.n;
    double index[3], value = 0, along[3] = {0, 0, 0};
    sdm_grid_index(&o->grid, x, index);
    for (int64_t k = 0; k < n[2]; k++)
        for (int64_t j = 0; j < n[1]; j++) {
            const double z = weight(n[2], k, index[2], false), y = weight(n[1], j, index[1], false);
            const double dz = weight(n[2], k, index[2], true), dy = weight(n[1], j, index[1], true);
            if (z == 0 && y == 0 && dz == 0 && dy == 0) continue;
            for (int64_t i = 0; i < n[0]; i++) {
                const double c = o->c[(k * n[1] + j) * n[0] + i],
                             w = weight(n[0], i, index[0], false);
                value += w * y * z * c;
                along[0] += weight(n[0], i, index[0], true) * y * z * c;
                along[1] += w * dy * z * c;
                along[2] += w * y * dz * c;
            }
        }
    for (int b = 0; b < 3 && gradient; b++) {
        gradient[b] = 0;
        for (int a = 0; a < 3; a++)
            gradient[b] += o->grid.dir[3 * b + a] * along[a] / o->grid.spacing[a];
    }
    return value;
}

// ---- the scene

typedef struct scene {
    sdm_model *model[2]; // straight, turned
    sdm_registry *registry;
    sdm_instance *shape;
    float map[2][BALL_VOXELS], jacobian[2][2 * BALL_VOXELS];
    oracle value[2], slope[2][2];
} scene;

static int open_scene(void **state)
{
    static scene s;
    sdm_error err;
    for (int t = 0; t < 2; t++) {
        const sdm_grid g = model_grid(t);
        s.model[t] = ball_model("bulge", &g, ripple);
        if (sdm_generate_jacobian(s.model[t], params, NULL, s.map[t], s.jacobian[t], NULL, &err))
            return -1;
        oracle_fit(&g, s.map[t], &s.value[t]);
        for (size_t p = 0; p < 2; p++)
            oracle_fit(&g, s.jacobian[t] + p * sdm_grid_count(&g), &s.slope[t][p]);
    }
    *state = &s;
    return sdm_registry_create(&s.registry, &err) ||
                   sdm_registry_add(s.registry, &ball_shape, "test", &err) ||
                   sdm_runtime_instance(s.model[0], s.registry, &s.shape, &err)
               ? -1
               : 0;
}

static int close_scene(void **state)
{
    scene *s = *state;
    sdm_instance_free(s->shape);
    sdm_registry_free(s->registry);
    for (int t = 0; t < 2; t++) sdm_model_free(s->model[t]);
    return 0;
}

static sdm_field *open_field(const sdm_model *m, const sdm_generate_opts *opts, bool derivatives)
{
    sdm_field *f;
    sdm_error err;
    if (sdm_field_create(m, opts, derivatives, &f, &err)) fail_msg("%s", err.text);
    if (sdm_field_set_params(f, params, NULL, &err)) fail_msg("%s", err.text);
    return f;
}

static double uniform(uint64_t i) { return sdm_rng_uniform(SEED, 1, i); }

/* Random point i in the box of a grid. */
static void random_point(const sdm_grid *g, uint64_t i, double x[3])
{
    double index[3];
    for (int a = 0; a < 3; a++) index[a] = uniform(3 * i + (uint64_t)a) * (double)(g->n[a] - 1);
    sdm_grid_world(g, index, x);
}

static bool same(const float *a, const float *b, size_t n) { return !memcmp(a, b, n * sizeof *a); }

// ---- grids

static void test_own_grid_has_the_bits_of_the_map(void **state)
{
    const scene *s = *state;
    static float values[BALL_VOXELS], slopes[2 * BALL_VOXELS], plain[BALL_VOXELS];
    for (int t = 0; t < 2; t++) {
        const sdm_grid g = model_grid(t);
        const size_t n = sdm_grid_count(&g);
        sdm_result r;
        assert_false(sdm_generate_grid(s->model[t], params, NULL, &g, values, slopes, &r, NULL));
        assert_true(same(values, s->map[t], n) && same(slopes, s->jacobian[t], 2 * n));
        assert_true(r.source == SDM_SOURCE_NETWORK && r.error_mm == 0.0125);
        assert_false(sdm_generate(s->model[t], params, NULL, plain, NULL, NULL));
        assert_false(sdm_generate_grid(s->model[t], params, NULL, &g, values, NULL, NULL, NULL));
        assert_true(same(values, plain, n));
    }
}

/* A grid inside the box of the model: its axes `order` of the model's grid, mirrored where the
   spacing is negative, voxel (0, 0, 0) at index `first`; turned by `angle` about it in addition. */
static sdm_grid inner_grid(const sdm_grid *m, const int order[3], const double first[3],
                           const double spacing[3], const int64_t n[3], double angle)
{
    sdm_grid g = {.n = {n[0], n[1], n[2]}};
    double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    if (angle != 0) turn(angle, rotation);
    sdm_grid_world(m, first, g.origin);
    for (int b = 0; b < 3; b++) {
        g.spacing[b] = fabs(spacing[b]);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                g.dir[3 * i + b] +=
                    rotation[3 * i + k] * m->dir[3 * k + order[b]] * copysign(1, spacing[b]);
    }
    return g;
}

typedef struct grid_case {
    int order[3];
    double first[3], spacing[3];
    int64_t n[3];
    double angle;
} grid_case;

static const grid_case cases[] = {
    {{0, 1, 2}, {0, 0, 0}, {0.0625, 0.0775, 0.07}, {65, 45, 53}, 0},      // a quarter of a voxel
    {{0, 1, 2}, {3.3, 1.2, 4.9}, {0.031, 0.031, 0.031}, {37, 25, 19}, 0}, // anywhere
    {{0, 1, 2}, {15.5, 1.2, 12.9}, {-0.11, 0.1, -0.07}, {31, 20, 44}, 0}, // mirrored
    {{2, 0, 1}, {1.5, 1.2, 2.9}, {0.11, -0.01, 0.07}, {21, 30, 33}, 0},   // other order
    {{0, 1, 2}, {1, 2, 0}, {0.5, 0.62, 0.56}, {8, 5, 7}, 0},              // coarser
    {{0, 1, 2}, {6, 5, 6}, {0.05, 0.04, 0.05}, {12, 9, 10}, 0.3},         // turned
};
enum { N_CASES = sizeof cases / sizeof *cases };

static sdm_grid case_grid(const sdm_grid *model, const grid_case *c)
{
    return inner_grid(model, c->order, c->first, c->spacing, c->n, c->angle);
}

static void test_grids_agree_with_the_oracle(void **state)
{
    const scene *s = *state;
    for (int t = 0; t < 2; t++)
        for (int c = 0; c < N_CASES; c++) {
            const sdm_grid m = model_grid(t), g = case_grid(&m, &cases[c]);
            const size_t n = sdm_grid_count(&g);
            float *values = malloc(3 * n * sizeof *values), *slopes = values + n;
            sdm_error err;
            if (sdm_generate_grid(s->model[t], params, NULL, &g, values, slopes, NULL, &err))
                fail_msg("case %d: %s", c, err.text);
            for (uint64_t i = 0; i < 300; i++) {
                const size_t v = (size_t)(uniform(i) * (double)n);
                double x[3];
                sdm_grid_world(&g,
                               (const double[]){(double)(v % (size_t)g.n[0]),
                                                (double)(v / (size_t)g.n[0] % (size_t)g.n[1]),
                                                (double)(v / (size_t)(g.n[0] * g.n[1]))},
                               x);
                assert_true(fabs((double)values[v] - oracle_at(&s->value[t], x, NULL)) < 2e-6);
                for (size_t p = 0; p < 2; p++)
                    assert_true(fabs((double)slopes[p * n + v] -
                                     oracle_at(&s->slope[t][p], x, NULL)) < 2e-6);
            }
            free(values);
        }
}

/* Maps with one, two and three voxels along an axis. */
static void test_thin_maps(void **state)
{
    (void)state;
    static oracle o;
    static float map[BALL_VOXELS];
    for (int64_t thin = 1; thin <= 3; thin++)
        for (int a = 0; a < 3; a++) {
            int64_t n[3] = {9, 8, 7};
            n[a] = thin;
            const sdm_grid g = grid_of(n, (const double[]){0.25, 0.31, 0.28}, 0);
            sdm_model *m = ball_model("bulge", &g, ripple);
            assert_false(sdm_generate(m, params, NULL, map, NULL, NULL));
            oracle_fit(&g, map, &o);
            sdm_field *f = open_field(m, NULL, false);
            for (uint64_t i = 0; i < 50; i++) {
                double x[3], wanted[3];
                float value, gradient[3];
                random_point(&g, i, x);
                assert_false(sdm_field_point(f, x, &value, gradient, NULL, NULL));
                assert_true(fabs((double)value - oracle_at(&o, x, wanted)) < 2e-6);
                for (int b = 0; b < 3; b++)
                    assert_true(fabs((double)gradient[b] - wanted[b]) < 3e-5);
            }
            sdm_field_free(f);
            sdm_model_free(m);
        }
}

// ---- points

static void test_points_agree_with_the_oracle(void **state)
{
    const scene *s = *state;
    enum { N = 400 };
    static double x[N][3];
    static float values[N], gradient[N][3], slopes[N][2];
    for (int t = 0; t < 2; t++) {
        const sdm_grid g = model_grid(t);
        for (uint64_t i = 0; i < N; i++) random_point(&g, i, x[i]);
        sdm_error err;
        if (sdm_generate_points(s->model[t], params, NULL, x[0], N, values, gradient[0], slopes[0],
                                NULL, &err))
            fail_msg("%s", err.text);
        sdm_field *f = open_field(s->model[t], NULL, true);
        for (int i = 0; i < N; i++) {
            double wanted[3];
            float one, by_x[3], by_p[2];
            assert_true(fabs((double)values[i] - oracle_at(&s->value[t], x[i], wanted)) < 2e-6);
            for (int a = 0; a < 3; a++)
                assert_true(fabs((double)gradient[i][a] - wanted[a]) < 1e-5);
            for (int p = 0; p < 2; p++)
                assert_true(fabs((double)slopes[i][p] - oracle_at(&s->slope[t][p], x[i], NULL)) <
                            2e-6);
            assert_false(sdm_field_point(f, x[i], &one, by_x, by_p, NULL));
            assert_true(one == values[i] && same(by_x, gradient[i], 3) && same(by_p, slopes[i], 2));
        }
        sdm_field_free(f);
    }
}

static void test_points_have_the_bits_of_grids(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts bound = {.outside = SDM_OUTSIDE_BOUND};
    sdm_field *f = open_field(s->model[0], &bound, true);
    for (int c = 0; c < N_CASES; c++) {
        if (cases[c].order[0] != 0) continue; // the axes of the model in their order
        const sdm_grid m = model_grid(false);
        sdm_grid g = case_grid(&m, &cases[c]);
        for (int a = 0; a < 3; a++) g.origin[a] -= c == 2 ? 0.4 : 0; // leaves the box
        const size_t n = sdm_grid_count(&g);
        float *values = malloc(6 * n * sizeof *values), *slopes = values + n,
              *point = slopes + 2 * n, *by_params = point + n;
        double *x = malloc(3 * n * sizeof *x);
        for (size_t v = 0; v < n; v++)
            sdm_grid_world(&g,
                           (const double[]){(double)(v % (size_t)g.n[0]),
                                            (double)(v / (size_t)g.n[0] % (size_t)g.n[1]),
                                            (double)(v / (size_t)(g.n[0] * g.n[1]))},
                           x + 3 * v);
        assert_false(sdm_field_grid(f, &g, values, slopes, NULL));
        assert_false(sdm_field_points(f, x, n, point, NULL, by_params, NULL));
        assert_true(same(values, point, n));
        for (size_t v = 0; v < n; v++)
            assert_true(slopes[v] == by_params[2 * v] && slopes[n + v] == by_params[2 * v + 1]);
        free(x);
        free(values);
    }
    sdm_field_free(f);
}

// ---- bands

/* values[] = the whole map of blocks; also checks the places of the blocks and the values beyond
   the end of the grid. */
static void blocks_map(const sdm_blocks *b, float *values)
{
    const sdm_grid *g = &b->grid;
    const float width = (float)b->band_mm;
    for (int64_t v = 0; v < g->n[0] * g->n[1] * g->n[2]; v++) {
        const int64_t at[3] = {v % g->n[0], v / g->n[0] % g->n[1], v / g->n[0] / g->n[1]};
        const uint32_t tile = b->tile[(at[2] / 8 * b->n[1] + at[1] / 8) * b->n[0] + at[0] / 8];
        values[v] = tile == SDM_TILE_INSIDE ? -width
                    : tile == SDM_TILE_OUTSIDE
                        ? width
                        : b->values[tile][(at[2] % 8 * 8 + at[1] % 8) * 8 + at[0] % 8];
        for (int a = 0; a < 3 && tile < SDM_TILE_INSIDE; a++)
            assert_int_equal(b->first[tile][a], at[a] / 8 * 8);
    }
    for (size_t i = 0; i < b->n_block; i++)
        for (int v = 0; v < SDM_BLOCK_VOXELS; v++)
            if (b->first[i][0] + v % 8 >= g->n[0] || b->first[i][1] + v / 8 % 8 >= g->n[1] ||
                b->first[i][2] + v / 64 >= g->n[2])
                assert_true(b->values[i][v] == width);
}

/* A dense map and the band on the same grid agree. Returns the share of blocks with values. */
static double check_band(const sdm_field *f, const sdm_grid *g, double width)
{
    const size_t n = sdm_grid_count(g);
    float *dense = malloc(2 * n * sizeof *dense), *map = dense + n;
    sdm_blocks b;
    sdm_error err;
    if (sdm_field_grid(f, g, dense, NULL, &err)) fail_msg("%s", err.text);
    if (sdm_field_band(f, g, width, &b, &err)) fail_msg("%s", err.text);
    blocks_map(&b, map);
    const float w = (float)width;
    size_t near = 0;
    for (size_t v = 0; v < n; v++) {
        near += fabsf(dense[v]) < w;
        assert_true(map[v] == (dense[v] >= w ? w : dense[v] <= -w ? -w : dense[v]));
    }
    // no block has values without need, and blocks are numbered in their order
    const size_t blocks = (size_t)(b.n[0] * b.n[1] * b.n[2]);
    uint32_t next = 0;
    for (size_t i = 0; i < blocks; i++) {
        if (b.tile[i] >= SDM_TILE_INSIDE) continue;
        assert_int_equal(b.tile[i], next++);
        size_t in_band = 0, inside = 0;
        const float *values = b.values[b.tile[i]];
        for (size_t v = 0; v < SDM_BLOCK_VOXELS; v++) {
            in_band += fabsf(values[v]) < w;
            inside += values[v] < 0;
            assert_true(isfinite(values[v]));
        }
        assert_true(in_band > 0 || (inside > 0 && inside < SDM_BLOCK_VOXELS));
    }
    assert_int_equal(next, b.n_block);
    assert_true(near == 0 || next > 0);
    sdm_blocks_dispose(&b);
    free(dense);
    return (double)next / (double)blocks;
}

static double steep(const double x[3])
{
    return 40 * sin(2 * x[0]) * sin(3 * x[1]) * cos(2 * x[2]);
}

static void test_band_is_part_of_the_map(void **state)
{
    const scene *s = *state;
    for (int t = 0; t < 2; t++) {
        const sdm_grid m = model_grid(t);
        sdm_field *f = open_field(s->model[t], NULL, false);
        for (int c = 0; c < N_CASES; c++) {
            const sdm_grid g = case_grid(&m, &cases[c]);
            const double edge = fmax(g.spacing[0], fmax(g.spacing[1], g.spacing[2]));
            check_band(f, &g, edge);
            check_band(f, &g, 3 * edge);
        }
        // a fine grid: few of its blocks have values
        sdm_grid fine = m;
        for (int a = 0; a < 3; a++) {
            fine.n[a] = 8 * (m.n[a] - 1) + 1;
            fine.spacing[a] = m.spacing[a] / 8;
        }
        assert_true(check_band(f, &fine, 3 * 0.04) < 0.35);
        sdm_field_free(f);
    }
}

/* A map that changes by more than 1 mm per mm: the bound must follow it. */
static void test_band_of_a_steep_map(void **state)
{
    (void)state;
    const sdm_grid m = model_grid(false);
    sdm_model *model = ball_model("bulge", &m, steep);
    sdm_field *f = open_field(model, NULL, false);
    sdm_grid fine = m;
    for (int a = 0; a < 3; a++) {
        fine.n[a] = 6 * (m.n[a] - 1) + 1;
        fine.spacing[a] = m.spacing[a] / 6;
    }
    assert_true(check_band(f, &fine, 0.06) < 1);
    sdm_field_free(f);
    sdm_model_free(model);
}

// ---- threads and instruction sets

static void test_same_bits_for_threads_and_processors(void **state)
{
    const scene *s = *state;
    enum { N = 3000 };
    const sdm_grid m = model_grid(false), g = case_grid(&m, &cases[0]);
    const size_t n = sdm_grid_count(&g);
    float *first = malloc(n * sizeof *first), *values = malloc(n * sizeof *values);
    static double x[N][3];
    static float at[2][N], gradient[2][N][3];
    sdm_blocks bands[2] = {{.n_block = 0}};
    for (uint64_t i = 0; i < N; i++) random_point(&m, i, x[i]);
    for (int level = 0; level < SDM_PROCESSOR_LEVELS; level++)
        for (int threads = 1; threads <= 3; threads++) {
            if (sdm_processor_select(level) != level) continue;
            const bool other = level || threads > 1;
            const sdm_generate_opts o = {.n_threads = threads};
            sdm_field *f;
            assert_false(sdm_field_create(s->model[0], &o, false, &f, NULL));
            // the network, whose bits depend on the processor, uses one instruction set
            sdm_processor_select(-1);
            assert_false(sdm_field_set_params(f, params, NULL, NULL));
            sdm_processor_select(level);
            assert_false(sdm_field_grid(f, &g, other ? values : first, NULL, NULL));
            assert_false(sdm_field_points(f, x[0], N, at[other], gradient[other][0], NULL, NULL));
            assert_false(sdm_field_band(f, &g, 0.2, &bands[other], NULL));
            if (other) {
                assert_true(same(values, first, n) && same(at[0], at[1], N));
                assert_true(same(gradient[0][0], gradient[1][0], (size_t)3 * N));
                assert_int_equal(bands[0].n_block, bands[1].n_block);
                assert_memory_equal(bands[0].values, bands[1].values,
                                    bands[0].n_block * sizeof *bands[0].values);
                sdm_blocks_dispose(&bands[1]);
            }
            sdm_field_free(f);
        }
    sdm_processor_select(-1);
    sdm_blocks_dispose(&bands[0]);
    free(values);
    free(first);
}

// ---- outside of the box

/* A point at index[3] of the model's grid, and by how much (mm) it lies beyond the box. */
static double outer_point(const sdm_grid *g, const double index[3], double x[3], double nearest[3])
{
    double in[3], square = 0;
    for (int a = 0; a < 3; a++) {
        in[a] = fmin(fmax(index[a], 0), (double)(g->n[a] - 1));
        square += (index[a] - in[a]) * (index[a] - in[a]) * g->spacing[a] * g->spacing[a];
    }
    sdm_grid_world(g, index, x);
    sdm_grid_world(g, in, nearest);
    return sqrt(square);
}

static const double outer[][3] = {{-3, 5.2, 7.1}, {19.7, 5.2, 7.1}, {4.4, -2, 15},
                                  {-1, -2, -3},   {20, 15, 17},     {8, 6, 13.001}};
enum { N_OUTER = sizeof outer / sizeof *outer };

static void test_bound_outside(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_BOUND};
    for (int t = 0; t < 2; t++) {
        const sdm_grid g = model_grid(t);
        sdm_field *f = open_field(s->model[t], &o, true);
        for (int i = 0; i < N_OUTER; i++) {
            double x[3], nearest[3];
            float value, gradient[3], slopes[2];
            const double r = outer_point(&g, outer[i], x, nearest),
                         d = oracle_at(&s->value[t], nearest, NULL), bound = sqrt(r * r + d * d);
            assert_true(d > 0); // the ball lies in the box
            assert_false(sdm_field_point(f, x, &value, gradient, slopes, NULL));
            assert_true(fabs((double)value - bound) < 2e-6);
            for (int p = 0; p < 2; p++)
                assert_true(fabs((double)slopes[p] -
                                 d / bound * oracle_at(&s->slope[t][p], nearest, NULL)) < 2e-6);
            // the gradient agrees with central differences of the bound
            for (int a = 0; a < 3; a++) {
                const double h = 1e-3;
                float ends[2];
                for (int e = 0; e < 2; e++) {
                    double y[3] = {x[0], x[1], x[2]};
                    y[a] += e ? h : -h;
                    assert_false(sdm_field_point(f, y, &ends[e], NULL, NULL, NULL));
                }
                if (i != N_OUTER - 1) // that point lies too near to the box
                    assert_true(fabs(((double)ends[1] - (double)ends[0]) / (2 * h) -
                                     (double)gradient[a]) < 2e-3);
            }
        }
        sdm_field_free(f);
    }
}

/* The distance to a ball in the box is never below the bound, and the bound is no trivial one. */
static void test_bound_is_below_the_distance(void **state)
{
    (void)state;
    const sdm_grid g = model_grid(false);
    sdm_model *m = ball_model("bulge", &g, NULL);
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_BOUND};
    sdm_field *f = open_field(m, &o, false);
    double worst = 0;
    for (uint64_t i = 0; i < 2000; i++) {
        double index[3], x[3], nearest[3];
        for (int a = 0; a < 3; a++)
            index[a] = (3 * uniform(3 * i + (uint64_t)a) - 1) * (double)g.n[a];
        if (outer_point(&g, index, x, nearest) == 0) continue;
        const double exact = sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) - ball_radius(params);
        float value;
        assert_false(sdm_field_point(f, x, &value, NULL, NULL, NULL));
        assert_true((double)value < exact + 2e-3); // the spline's error
        worst = fmax(worst, exact - (double)value);
    }
    assert_true(worst < 1.7); // distances go up to 9 mm
    sdm_field_free(f);
    sdm_model_free(m);
}

static void test_refused_outside(void **state)
{
    const scene *s = *state;
    const sdm_grid m = model_grid(false);
    sdm_grid g = m;
    static float values[BALL_VOXELS];
    sdm_blocks band;
    sdm_error err;
    g.origin[0] -= 0.01;
    assert_int_equal(sdm_generate_grid(s->model[0], params, NULL, &g, values, NULL, NULL, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "the grid leaves the box"));
    assert_non_null(strstr(err.text, "bound, exact"));
    double x[6] = {0, 0, 0, 9, 1, 1};
    assert_int_equal(
        sdm_generate_points(s->model[0], params, NULL, x, 2, values, NULL, NULL, NULL, &err),
        SDM_E_RANGE);
    assert_non_null(strstr(err.text, "point 1 (9, 1, 1) mm lies outside of the box"));
    // roundings of a position on the face of the box are no reason
    x[3] = m.origin[0] - 1e-12;
    assert_false(
        sdm_generate_points(s->model[0], params, NULL, x, 2, values, NULL, NULL, NULL, &err));
    // a band that stays in the box may be asked for on a grid that leaves it
    assert_false(sdm_generate_band(s->model[0], params, NULL, &g, 0.4, &band, NULL, &err));
    assert_true(band.n_block > 0);
    sdm_blocks_dispose(&band);
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, &g, 3, &band, NULL, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "the band leaves the box"));
    assert_true(!band.values && !band.tile);
}

static void test_band_with_bound(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_BOUND};
    for (int t = 0; t < 2; t++) {
        sdm_grid g = model_grid(t);
        sdm_field *f = open_field(s->model[t], &o, false);
        for (int a = 0; a < 3; a++) g.origin[a] -= 0.7, g.n[a] = 50, g.spacing[a] /= 2;
        check_band(f, &g, 1.2);
        sdm_field_free(f);
    }
}

static void test_exact_outside(void **state)
{
    const scene *s = *state;
    const sdm_generate_opts o = {.outside = SDM_OUTSIDE_EXACT, .exact_shape = s->shape};
    sdm_grid g = model_grid(false);
    for (int a = 0; a < 3; a++) g.origin[a] -= 0.7;
    const size_t n = sdm_grid_count(&g);
    static float values[BALL_VOXELS], exact[BALL_VOXELS], bound[BALL_VOXELS], slopes[2];
    assert_false(sdm_exact_shape_map(s->shape, params, NULL, &g, exact, NULL, NULL));
    assert_false(sdm_generate_grid(s->model[0], params, &o, &g, values, NULL, NULL, NULL));
    sdm_field *f = open_field(s->model[0], &(sdm_generate_opts){.outside = SDM_OUTSIDE_BOUND},
                              false),
              *e = open_field(s->model[0], &o, true);
    assert_false(sdm_field_grid(f, &g, bound, NULL, NULL));
    size_t n_exact = 0;
    for (size_t v = 0; v < n; v++) {
        const double index[3] = {(double)(v % (size_t)g.n[0]),
                                 (double)(v / (size_t)g.n[0] % (size_t)g.n[1]),
                                 (double)(v / (size_t)(g.n[0] * g.n[1]))};
        const bool out = index[0] * 0.25 < 0.7 || index[1] * 0.31 < 0.7 || index[2] * 0.28 < 0.7;
        n_exact += out;
        assert_true(values[v] == (out ? exact[v] : bound[v]));
    }
    assert_true(n_exact > n / 4 && n_exact < n);
    // a point, its derivatives, and a band that leaves the box
    const double x[3] = {3, 1, -2};
    float value, gradient[3];
    sdm_error err;
    assert_false(sdm_field_point(e, x, &value, gradient, NULL, &err));
    const double r = sqrt(14);
    assert_true(fabs((double)value - (r - ball_radius(params))) < 5e-3);
    for (int a = 0; a < 3; a++) assert_true(fabs((double)gradient[a] - x[a] / r) < 0.05);
    assert_int_equal(sdm_field_point(e, x, &value, NULL, slopes, &err), SDM_E_UNSUPPORTED);
    assert_int_equal(sdm_field_grid(e, &g, values, exact, &err), SDM_E_UNSUPPORTED);
    check_band(e, &g, 1.5);
    sdm_field_free(e);
    sdm_field_free(f);
}

// ---- policies and errors

static void test_policies_out_of_range(void **state)
{
    const scene *s = *state;
    const double p[2] = {1.7, 0.5}, edge[2] = {1.5, 0.5};
    const sdm_grid m = model_grid(false), g = case_grid(&m, &cases[1]);
    const size_t n = sdm_grid_count(&g);
    float *values = malloc(2 * n * sizeof *values), *wanted = values + n;
    sdm_result r;
    sdm_error err;
    assert_int_equal(sdm_generate_grid(s->model[0], p, NULL, &g, values, NULL, &r, &err),
                     SDM_E_RANGE);
    assert_non_null(strstr(err.text, "'radius' = 1.7 mm"));
    const sdm_generate_opts clamp = {.policy = SDM_RANGE_CLAMP},
                            exact = {.policy = SDM_RANGE_EXACT, .exact_shape = s->shape};
    assert_false(sdm_generate_grid(s->model[0], p, &clamp, &g, values, NULL, &r, &err));
    assert_false(sdm_generate_grid(s->model[0], edge, NULL, &g, wanted, NULL, NULL, &err));
    assert_true(r.clamped && same(values, wanted, n));
    // exact values on the grid and at points
    assert_false(sdm_generate_grid(s->model[0], p, &exact, &g, values, NULL, &r, &err));
    assert_false(sdm_exact_shape_map(s->shape, p, NULL, &g, wanted, NULL, &err));
    assert_true(r.source == SDM_SOURCE_EXACT && same(values, wanted, n));
    const double x[3] = {5, 0, 0};
    assert_false(sdm_generate_points(s->model[0], p, &exact, x, 1, values, wanted, NULL, &r, &err));
    assert_true(r.source == SDM_SOURCE_EXACT);
    assert_true(fabs((double)values[0] - 3.25) < 5e-3 && fabs((double)wanted[0] - 1) < 0.05);
    sdm_blocks band;
    if (sdm_generate_band(s->model[0], p, &exact, &m, 1, &band, &r, &err)) fail_msg("%s", err.text);
    static float map[BALL_VOXELS], whole[BALL_VOXELS];
    blocks_map(&band, map);
    assert_false(sdm_exact_shape_map(s->shape, p, NULL, &m, whole, NULL, &err));
    for (size_t v = 0; v < sdm_grid_count(&m); v++)
        assert_true(map[v] == fmaxf(-1, fminf(whole[v], 1)));
    sdm_blocks_dispose(&band);
    free(values);
}

static void test_check_on_a_grid(void **state)
{
    const scene *s = *state;
    const sdm_grid m = model_grid(false);
    sdm_grid g = m;
    for (int a = 0; a < 3; a++) g.n[a] = 2 * m.n[a] - 1, g.spacing[a] /= 2;
    const size_t n = sdm_grid_count(&g);
    float *values = malloc(4 * n * sizeof *values), *exact = values + n, *slopes = exact + n;
    sdm_result r;
    sdm_error err;
    sdm_generate_opts o = {.check = true, .exact_shape = s->shape};
    assert_false(sdm_generate_grid(s->model[0], params, &o, &g, values, NULL, &r, &err));
    assert_true(r.checked && r.check.used == SDM_CHECK_POINTS && r.check.max_mm > 0.01);
    o.max_error_mm = 1e-3; // the ripple is no ball
    assert_int_equal(sdm_generate_grid(s->model[0], params, &o, &g, values, NULL, &r, &err),
                     SDM_E_QUALITY);
    o.policy = SDM_RANGE_EXACT;
    assert_false(sdm_generate_grid(s->model[0], params, &o, &g, values, slopes, &r, &err));
    assert_false(sdm_exact_shape_map(s->shape, params, NULL, &g, exact, NULL, &err));
    assert_true(r.reason == SDM_REASON_ERROR && same(values, exact, n));
    assert_false(sdm_exact_shape_jacobian(s->shape, params, NULL, &g, NULL, values, NULL, &err));
    assert_true(same(slopes, values, n));
    free(values);
}

static void refuse_grid(const scene *s, const sdm_grid *g, const char *what)
{
    float value[1];
    sdm_blocks band;
    sdm_error err;
    assert_int_equal(sdm_generate_grid(s->model[0], params, NULL, g, value, NULL, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, what));
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, g, 1, &band, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, what));
}

static void test_wrong_arguments_are_refused(void **state)
{
    const scene *s = *state;
    const sdm_grid good = model_grid(false);
    sdm_grid g = good;
    g.spacing[1] = 0;
    refuse_grid(s, &g, "spacing along y is 0 mm");
    g = good, g.origin[2] = NAN;
    refuse_grid(s, &g, "origin along z");
    g = good, g.dir[1] = 0.1;
    refuse_grid(s, &g, "not orthonormal");
    g = good, g.n[0] = 0;
    refuse_grid(s, &g, "size along x is 0");
    // a band with too many blocks, too narrow
    sdm_blocks band;
    sdm_error err;
    g = good;
    for (int a = 0; a < 3; a++) g.n[a] = 1 << 15, g.spacing[a] = 1e-6;
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, &g, 1, &band, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, "use larger voxels"));
    assert_int_equal(sdm_generate_band(s->model[0], params, NULL, &good, 0.3, &band, NULL, &err),
                     SDM_E_ARG);
    assert_non_null(strstr(err.text, "band of 0.3 mm"));
    // points and fields
    const double bad[6] = {0, 0, 0, 0, NAN, 0};
    float values[4], slopes[4];
    assert_int_equal(
        sdm_generate_points(s->model[0], params, NULL, bad, 2, values, NULL, NULL, NULL, &err),
        SDM_E_ARG);
    assert_non_null(strstr(err.text, "point 1"));
    sdm_field *f;
    const sdm_generate_opts check = {.check = true, .exact_shape = s->shape};
    assert_int_equal(sdm_field_create(s->model[0], &check, false, &f, &err), SDM_E_ARG);
    const sdm_generate_opts unknown = {.outside = (sdm_outside)7};
    assert_int_equal(sdm_field_create(s->model[0], &unknown, false, &f, &err), SDM_E_ARG);
    const sdm_generate_opts shapeless = {.outside = SDM_OUTSIDE_EXACT};
    assert_int_equal(sdm_field_create(s->model[0], &shapeless, false, &f, &err), SDM_E_ARG);
    assert_false(sdm_field_create(s->model[0], NULL, false, &f, &err));
    assert_int_equal(sdm_field_point(f, bad, values, NULL, NULL, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "sdm_field_set_params() comes first"));
    assert_false(sdm_field_set_params(f, params, NULL, &err));
    assert_int_equal(sdm_field_point(f, bad, values, NULL, slopes, &err), SDM_E_ARG);
    assert_non_null(strstr(err.text, "without derivatives"));
    const double wild[2] = {NAN, 0};
    assert_int_equal(sdm_field_set_params(f, wild, NULL, &err), SDM_E_RANGE);
    assert_int_equal(sdm_field_point(f, bad, values, NULL, NULL, &err), SDM_E_ARG);
    sdm_field_free(f);
    sdm_field_free(NULL);
}

static void test_each_allocation_may_fail(void **state)
{
    const scene *s = *state;
    const sdm_grid m = model_grid(false), g = case_grid(&m, &cases[4]);
    const sdm_generate_opts o = {.n_threads = 1};
    float values[280], slopes[560];
    sdm_error err;
    unsigned long failures = 0;
    for (unsigned long i = 1, failing = 1; failing; i++) {
        sdm_blocks band;
        sdm_alloc_fail_after(i);
        const sdm_status a =
            sdm_generate_grid(s->model[0], params, &o, &g, values, slopes, NULL, &err);
        sdm_alloc_fail_after(i);
        const sdm_status b = sdm_generate_band(s->model[0], params, &o, &g, 0.7, &band, NULL, &err);
        sdm_alloc_fail_after(0);
        assert_true(!a || a == SDM_E_NOMEM);
        assert_true(!b || b == SDM_E_NOMEM);
        if (b) assert_true(!band.values && !band.tile);
        sdm_blocks_dispose(&band);
        failing = a || b;
        failures += failing;
    }
    assert_true(failures > 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_own_grid_has_the_bits_of_the_map),
        cmocka_unit_test(test_grids_agree_with_the_oracle),
        cmocka_unit_test(test_thin_maps),
        cmocka_unit_test(test_points_agree_with_the_oracle),
        cmocka_unit_test(test_points_have_the_bits_of_grids),
        cmocka_unit_test(test_band_is_part_of_the_map),
        cmocka_unit_test(test_band_of_a_steep_map),
        cmocka_unit_test(test_same_bits_for_threads_and_processors),
        cmocka_unit_test(test_bound_outside),
        cmocka_unit_test(test_bound_is_below_the_distance),
        cmocka_unit_test(test_refused_outside),
        cmocka_unit_test(test_band_with_bound),
        cmocka_unit_test(test_exact_outside),
        cmocka_unit_test(test_policies_out_of_range),
        cmocka_unit_test(test_check_on_a_grid),
        cmocka_unit_test(test_wrong_arguments_are_refused),
        cmocka_unit_test(test_each_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, open_scene, close_scene);
}
