/* A small random pod network: its model, and its map by plain double arithmetic. Include cmocka.h
 * first. */
#ifndef TEST_POD_TOY_H
#define TEST_POD_TOY_H

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "toy_params.h"

enum { P = 3, DEPTH = 2, WIDTH = 70, DEGREE = 3, INPUT_DEGREE = 2 };

/* Levels of the networks that toy_make() makes, and voxels along an edge of their blocks. */
static size_t n_levels = 3, block = 2;

/* A network whose weights are plain arrays. */
typedef struct toy {
    sdm_model_param params[P];
    sdm_model_info info;
    sdm_pod_spec spec;
    sdm_pod_block blocks[80];
    float *memory, *layer[DEPTH], *bias[DEPTH], *head, *mean, *basis;
} toy;

/* Fills *t, with an activation of sdm_activate(). The caller frees t->memory. */
static inline void toy_make(toy *t, sdm_pod_type type, int activation)
{
    *t = (toy){0};
    toy_params_fill(t->params, P);
    static const char *const names[] = {"edge", "ear"}, *const values[] = {"0.3", "left"};
    t->info = (sdm_model_info){
        .n_params = P,
        .params = t->params,
        .n_options = 2,
        .option_names = names,
        .option_values = values,
        .grid = sdm_grid_centred((const int64_t[]){9, 7, 5}, 0.2, (const double[]){1, 2, 3}),
        .seed = 77,
        .train_seconds = 1.25,
        .train_samples = 1234,
        .config = "seed: 77\n"};
    t->info.accuracy =
        (sdm_accuracy){100, 1e-5, 0.003, 0.002, 0.1, 0.005, 0.001, 0.002, 0.003, 0.6};
    snprintf(t->info.shape, sizeof t->info.shape, "toy");
    sdm_pod_arch *a = &t->spec.arch;
    *a = (sdm_pod_arch){.n_params = P,
                        .degree = DEGREE,
                        .input_degree = INPUT_DEGREE,
                        .depth = DEPTH,
                        .width = WIDTH,
                        .block = block,
                        .activation = activation,
                        .n_terms = sdm_poly_count(P, DEGREE),
                        .n_inputs = sdm_poly_count(P, INPUT_DEGREE) - 1,
                        .n_voxels = 9 * 7 * 5,
                        .levels = sdm_pod_count(&t->info.grid, block, n_levels)};
    a->n_latent = a->n_terms + WIDTH;
    const size_t n_blocks = a->levels.first[n_levels];
    assert_true(a->levels.n == n_levels && n_blocks <= 80);
    sdm_pod_blocks(&t->info.grid, block, &a->levels, t->blocks);
    // Block 2 has rank 0 (its mean only). No block may have more basis functions than outputs: its
    // voxels, or on higher levels the coefficients of its children.
    size_t basis = 0;
    for (size_t b = 0; b < n_blocks; b++) {
        sdm_pod_block *k = &t->blocks[b];
        uint32_t outputs = k->size[0] * k->size[1] * k->size[2];
        if (k->n_children) outputs = 0;
        for (size_t i = k->child; i < k->child + k->n_children; i++) outputs += t->blocks[i].rank;
        const uint32_t wanted = (uint32_t)(b % 5 + (k->n_children ? 9 : 1));
        k->rank = b == 2 ? 0 : wanted < outputs ? wanted : outputs;
        basis += outputs * k->rank;
    }
    sdm_pod_number(&a->levels, t->blocks);
    for (size_t b = a->levels.first[n_levels - 1]; b < n_blocks; b++)
        a->n_coefficients += t->blocks[b].rank;
    const size_t n = WIDTH * a->n_inputs + WIDTH * WIDTH + 2 * WIDTH +
                     a->n_coefficients * a->n_latent + a->n_voxels + basis;
    assert_int_equal(SDM_ALLOC(&t->memory, n, "toy", NULL), SDM_OK);
    for (size_t i = 0; i < n; i++) t->memory[i] = (float)(0.3 * sdm_rng_normal(11, 1, i));
    float *at = t->memory;
    for (int l = 0; l < DEPTH; l++) {
        t->layer[l] = at, at += WIDTH * (l ? WIDTH : a->n_inputs);
        t->bias[l] = at, at += WIDTH;
        t->spec.weights.layer[l] = t->layer[l], t->spec.weights.bias[l] = t->bias[l];
    }
    t->spec.weights.head = t->head = at, at += a->n_coefficients * a->n_latent;
    t->spec.weights.mean = t->mean = at, at += a->n_voxels;
    t->spec.weights.basis = t->basis = at;
    t->spec.info = &t->info;
    t->spec.blocks = t->blocks;
    t->spec.type = type;
}

/* The model of the network; the caller frees it. */
static inline sdm_model *toy_open(const toy *t)
{
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    assert_int_equal(sdm_pod_build(&t->spec, &bytes, &size, NULL), SDM_OK);
    assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, NULL), SDM_OK);
    sdm_free(bytes);
    return m;
}

/* Normalised Legendre polynomials, n = 0 .. 3, in closed form. */
static inline double legendre(int n, double x)
{
    switch (n) {
    case 0:
        return 1;
    case 1:
        return sqrt(3) * x;
    case 2:
        return sqrt(5) * 0.5 * (3 * x * x - 1);
    default:
        return sqrt(7) * 0.5 * (5 * x * x * x - 3 * x);
    }
}

static inline double activate(int kind, double x)
{
    return kind == 0 ? x / (1 + exp(-x)) : kind == 1 ? tanh(x) : x > 0 ? x : 0;
}

/* map[5][7][9] = the map at p[P], as sdm/internal/pod.h defines it, in double and without blocking.
 */
static inline void reference(const toy *t, const double *p, double *map)
{
    const sdm_pod_arch *a = &t->spec.arch;
    uint8_t exponents[64 * P];
    sdm_poly_table(P, DEGREE, exponents);
    double z[64 + WIDTH], h[WIDTH], next[WIDTH];
    for (size_t f = 0; f < a->n_terms; f++) {
        z[f] = 1;
        for (int i = 0; i < P; i++)
            z[f] *=
                legendre(exponents[f * P + (size_t)i],
                         2 * (p[i] - t->params[i].min) / (t->params[i].max - t->params[i].min) - 1);
    }
    for (int l = 0; l < DEPTH; l++) {
        const size_t k = l ? WIDTH : a->n_inputs;
        for (size_t o = 0; o < WIDTH; o++) {
            double s = t->bias[l][o];
            for (size_t i = 0; i < k; i++) s += t->layer[l][o * k + i] * (l ? h[i] : z[1 + i]);
            next[o] = activate(a->activation, s);
        }
        memcpy(h, next, sizeof h);
    }
    memcpy(z + a->n_terms, h, sizeof h);
    // Coefficients from the highest level down to level 0, then the map.
    const size_t n_blocks = a->levels.first[n_levels];
    double c[80][64] = {{0}};
    const float *weights[80], *at = t->basis;
    for (size_t b = 0; b < n_blocks; b++) {
        weights[b] = at;
        at += t->blocks[b].rank * sdm_pod_outputs(t->blocks, b);
    }
    for (size_t b = n_blocks; b-- > 0;) {
        const sdm_pod_block *k = &t->blocks[b];
        assert_true(k->rank <= 64);
        if (b >= a->levels.first[n_levels - 1])
            for (size_t r = 0; r < k->rank; r++)
                for (size_t i = 0; i < a->n_latent; i++)
                    c[b][r] += t->head[(k->coefficient + r) * a->n_latent + i] * z[i];
        const size_t outputs = sdm_pod_outputs(t->blocks, b);
        size_t o = 0;
        for (size_t i = k->child; i < k->child + k->n_children; i++)
            for (size_t q = 0; q < t->blocks[i].rank; q++, o++)
                for (size_t r = 0; r < k->rank; r++)
                    c[i][q] += c[b][r] * weights[b][r * outputs + o];
        for (size_t v = 0; v < outputs && !k->n_children; v++) {
            const size_t x = k->at[0] + v % k->size[0], y = k->at[1] + v / k->size[0] % k->size[1],
                         zz = k->at[2] + v / k->size[0] / k->size[1];
            double s = t->mean[k->voxel + v];
            for (size_t r = 0; r < k->rank; r++) s += c[b][r] * weights[b][r * outputs + v];
            map[(zz * 7 + y) * 9 + x] = s;
        }
    }
}

/* p[P] = random parameters within their ranges: the same for the same index. */
static inline void random_params(uint64_t index, double *p)
{
    for (int i = 0; i < P; i++)
        p[i] = -1.0 - i + (3.0 + 2 * i) * sdm_rng_uniform(5, 5, index * P + (uint64_t)i);
}

/* Runs the tests for all instruction sets of the machine and two sizes of blocks. Returns the
 * number of tests that fail. */
#define toy_run(tests) toy_run_count(tests, sizeof(tests) / sizeof *(tests))
static inline int toy_run_count(const struct CMUnitTest *tests, size_t n)
{
    int failed = 0;
    for (int level = sdm_processor_select(-1); level >= 0; level--) {
        sdm_processor_select(level);
        for (block = 2; block <= 4; block += 2)
            failed += _cmocka_run_group_tests(sdm_kernels_name(), tests, n, NULL, NULL);
    }
    return failed;
}

#endif
