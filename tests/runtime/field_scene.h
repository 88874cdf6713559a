/* The scene of the tests of fields: models of a ball with a rippled surface on straight and turned
 * axes, grids in their box, and splines that are solved and evaluated in double precision by other
 * formulas. Include cmocka.h first. */
#ifndef SDM_TEST_FIELD_SCENE_H
#define SDM_TEST_FIELD_SCENE_H

#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "runtime/ball_model.h"
#include "sdm/field.h"
#include "sdm/internal/rng.h"

enum { SEED = 5 };

static const double params[2] = {1.31, 0.4};

static inline double ripple(const double x[3])
{
    return 1 + 0.4 * sin(3 * x[0]) * cos(2 * x[1] + x[2]);
}

/* A turned orthonormal matrix. */
static inline void turn(double angle, double dir[9])
{
    const double c = cos(angle), s = sin(angle), r = 0.6, q = 0.8;
    const double d[9] = {c, -s * r, s * q, s, c * r, -c * q, 0, q, r};
    memcpy(dir, d, sizeof d);
}

static inline sdm_grid grid_of(const int64_t n[3], const double spacing[3], double angle)
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
static inline sdm_grid model_grid(bool turned)
{
    return grid_of((const int64_t[]){17, 12, 14}, (const double[]){0.25, 0.31, 0.28},
                   turned ? 0.7 : 0);
}

// ---- the oracle

/* beta(x) = sum over k of (-1)^k binomial(4, k) max(x + 2 - k, 0)^3 / 6, and its derivative
   (Schoenberg 1946). */
static inline double beta(double x, bool slope)
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
static inline double weight(int64_t n, int64_t i, double x, bool slope)
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
static inline void solve_axis(const int64_t n[3], int a, double *c)
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

static inline void oracle_fit(const sdm_grid *g, const float *values, oracle *o)
{
    o->grid = *g;
    for (size_t i = 0; i < sdm_grid_count(g); i++) o->c[i] = (double)values[i];
    for (int a = 0; a < 3; a++) solve_axis(g->n, a, o->c);
}

/* The spline at x; gradient (NULL: not wanted) by the world coordinates. */
static inline double oracle_at(const oracle *o, const double x[3], double *gradient)
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

static inline int open_scene(void **state)
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

static inline int close_scene(void **state)
{
    scene *s = *state;
    sdm_instance_free(s->shape);
    sdm_registry_free(s->registry);
    for (int t = 0; t < 2; t++) sdm_model_free(s->model[t]);
    return 0;
}

static inline sdm_field *open_field(const sdm_model *m, const sdm_generate_opts *opts,
                                    bool derivatives)
{
    sdm_field *f;
    sdm_error err;
    if (sdm_field_create(m, opts, derivatives, &f, &err)) fail_msg("%s", err.text);
    if (sdm_field_set_params(f, params, NULL, &err)) fail_msg("%s", err.text);
    return f;
}

static inline double uniform(uint64_t i) { return sdm_rng_uniform(SEED, 1, i); }

/* Random point i in the box of a grid. */
static inline void random_point(const sdm_grid *g, uint64_t i, double x[3])
{
    double index[3];
    for (int a = 0; a < 3; a++) index[a] = uniform(3 * i + (uint64_t)a) * (double)(g->n[a] - 1);
    sdm_grid_world(g, index, x);
}

static inline bool same(const float *a, const float *b, size_t n)
{
    return !memcmp(a, b, n * sizeof *a);
}

// ---- grids in the box

/* A grid inside the box of the model: its axes `order` of the model's grid, mirrored where the
   spacing is negative, voxel (0, 0, 0) at index `first`; turned by `angle` about it in addition. */
static inline sdm_grid inner_grid(const sdm_grid *m, const int order[3], const double first[3],
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

static inline sdm_grid case_grid(const sdm_grid *model, const grid_case *c)
{
    return inner_grid(model, c->order, c->first, c->spacing, c->n, c->angle);
}

// ---- bands

/* values[] = the whole map of blocks; also checks the places of the blocks and the values beyond
   the end of the grid. */
static inline void blocks_map(const sdm_blocks *b, float *values)
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
static inline double check_band(const sdm_field *f, const sdm_grid *g, double width)
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

#endif
