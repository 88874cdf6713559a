/* The pod network: maps against plain double arithmetic, derivatives against differences, and
 * damaged model files.
 * Tests: container.c model_file.c model_open.c model_quality.c pod_build.c pod_decode.c
 * pod_decode_back.c pod_forward.c pod_latent.c pod_open.c pod_quantise.c pod_slabs.c pod_survey.c
 * polynomial.c */
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

#include "pod/pod_survey.h"
#include "sdm/internal/container.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/rng.h"

enum { P = 3, DEPTH = 2, WIDTH = 70, DEGREE = 3, INPUT_DEGREE = 2 };

static size_t n_levels = 3, block = 2;

// A small random network whose weights are plain arrays.
typedef struct toy {
    sdm_model_param params[P];
    sdm_model_info info;
    sdm_pod_spec spec;
    sdm_pod_block blocks[80];
    float *memory, *layer[DEPTH], *bias[DEPTH], *head, *mean, *basis;
} toy;

static void toy_make(toy *t, sdm_pod_type type, int activation)
{
    *t = (toy){0};
    for (int i = 0; i < P; i++) {
        snprintf(t->params[i].name, sizeof t->params[i].name, "p%d", i);
        snprintf(t->params[i].unit, sizeof t->params[i].unit, "mm");
        t->params[i].min = -1.0 - i, t->params[i].max = 2.0 + i, t->params[i].def = 0.5;
    }
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

static sdm_model *toy_open(const toy *t)
{
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    assert_int_equal(sdm_pod_build(&t->spec, &bytes, &size, NULL), SDM_OK);
    assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, NULL), SDM_OK);
    sdm_free(bytes);
    return m;
}

// Normalised Legendre polynomials, n = 0 .. 3, in closed form.
static double legendre(int n, double x)
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

static double activate(int kind, double x)
{
    return kind == 0 ? x / (1 + exp(-x)) : kind == 1 ? tanh(x) : x > 0 ? x : 0;
}

// The network as sdm/pod.h defines it, in double and without blocking.
static void reference(const toy *t, const double *p, double *map)
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

static void random_params(uint64_t index, double *p)
{
    for (int i = 0; i < P; i++)
        p[i] = -1.0 - i + (3.0 + 2 * i) * sdm_rng_uniform(5, 5, index * P + (uint64_t)i);
}

static void polynomials_match_closed_forms(void **state)
{
    (void)state;
    assert_int_equal(sdm_poly_count(4, 6), 210);
    assert_int_equal(sdm_poly_count(4, 8), 495);
    assert_true(sdm_poly_count(64, 64) == SIZE_MAX);
    uint8_t e[35 * 4];
    sdm_poly_table(4, 3, e);
    int last = 0;
    for (int i = 0; i < 35; i++) {
        const int total = e[4 * i] + e[4 * i + 1] + e[4 * i + 2] + e[4 * i + 3];
        assert_true(total >= last && total <= 3);
        last = total;
        for (int j = 0; j < i; j++) assert_memory_not_equal(e + 4 * i, e + 4 * j, 4);
    }
    // Values against closed forms, derivatives against differences.
    const double x[4] = {0.3, -0.7, 0.9, -1};
    float phi[35], dphi[4 * 35], high[35], low[35];
    sdm_poly_eval(e, 35, 4, 3, x, phi, dphi);
    for (int i = 0; i < 35; i++) {
        double product = 1;
        for (int d = 0; d < 4; d++) product *= legendre(e[4 * i + d], x[d]);
        assert_true(fabs(product - phi[i]) < 1e-5);
    }
    for (int d = 0; d < 4; d++) {
        double up[4], down[4];
        memcpy(up, x, sizeof x), memcpy(down, x, sizeof x);
        up[d] += 1e-3, down[d] -= 1e-3;
        sdm_poly_eval(e, 35, 4, 3, up, high, NULL);
        sdm_poly_eval(e, 35, 4, 3, down, low, NULL);
        for (int i = 0; i < 35; i++)
            assert_true(fabs(dphi[d * 35 + i] - (high[i] - low[i]) / 2e-3) < 2e-2);
    }
}

static void forward_is_the_definition(void **state)
{
    (void)state;
    for (int mode = 0; mode < 27; mode++) {
        n_levels = 3 - (size_t)mode / 9;
        toy t;
        toy_make(&t, (sdm_pod_type)(mode % 3), mode / 3 % 3);
        const double tolerance[] = {1e-5, 4e-3, 1e-2};
        sdm_model *m = toy_open(&t);
        const sdm_pod_arch *a = &t.spec.arch;
        enum { N = 19 };
        double p[N * P], truth[315];
        float *maps, single[315];
        void *scratch;
        assert_int_equal(SDM_ALLOC(&maps, N * 315, "maps", NULL), 0);
        assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, N), 1, "scratch", NULL), 0);
        for (uint64_t i = 0; i < N; i++) random_params(i, p + i * P);
        for (size_t i = 0; i < 8 * P;
             // The corners of the parameter box, where the integers of fixed-point inputs are
             // largest.
             i++)
            p[i] = i / P >> i % P & 1 ? t.params[i % P].max : t.params[i % P].min;
        sdm_model_forward(m, p, N, maps, scratch);
        double wrong = 0, spread = 0;
        for (size_t i = 0; i < N; i++) {
            reference(&t, p + i * P, truth);
            for (size_t b = 0; b < a->levels.first[1]; b++)
                for (size_t v = 0; v < sdm_pod_block_voxels(&t.blocks[b]); v++) {
                    const sdm_pod_block *k = &t.blocks[b];
                    const size_t at = ((k->at[2] + v / k->size[0] / k->size[1]) * 7 + k->at[1] +
                                       v / k->size[0] % k->size[1]) *
                                          9 +
                                      k->at[0] + v % k->size[0];
                    spread += pow(truth[at] - t.mean[k->voxel + v], 2);
                    wrong += pow(truth[at] - maps[i * 315 + at], 2);
                }
            double size = 0;
            for (int v = 0; v < 315; v++) size = fmax(size, fabs(truth[v]));
            for (int v = 0; v < 315; v++)
                assert_true(fabs(truth[v] - maps[i * 315 + (size_t)v]) <
                            tolerance[mode % 3] * size);
            sdm_model_forward(m, p + i * P, 1, single, scratch);
            assert_memory_equal(single, maps + i * 315, sizeof single);
        }
        // Rounding weights to bytes adds an error, but only a small share of the maps' variation
        // about their mean.
        assert_true(mode % 3 < 2 || (wrong > 0 && wrong < 1.5e-6 * spread));
        sdm_free(scratch);
        sdm_free(maps);
        sdm_model_free(m);
        sdm_free(t.memory);
    }
}

// Blocks of 5 voxels leave the last group of four rows partly filled; the padding must not be
// written into the next map.
static void partial_panels_stay_inside_their_map(void **state)
{
    (void)state;
    enum { N = 7 };
    const size_t usual = block, levels = n_levels;
    block = 5, n_levels = 2;
    toy t;
    toy_make(&t, SDM_POD_I8, 0);
    sdm_model *m = toy_open(&t);
    double p[N * P];
    static float maps[N * 315], single[315];
    void *scratch;
    assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, N), 1, "scratch", NULL), 0);
    for (uint64_t i = 0; i < N; i++) random_params(i, p + i * P);
    sdm_model_forward(m, p, N, maps, scratch);
    for (size_t i = 0; i < N; i++) {
        sdm_model_forward(m, p + i * P, 1, single, scratch);
        assert_memory_equal(single, maps + i * 315, sizeof single);
    }
    sdm_free(scratch);
    sdm_model_free(m);
    sdm_free(t.memory);
    block = usual, n_levels = levels;
}

// So many maps that the output bypasses the caches, at any alignment: each has the same bits as a
// map computed alone.
static void many_maps_equal_single_maps(void **state)
{
    (void)state;
    enum { N = 3300, SIDE = 16 };
    for (int type = 0; type < 3; type++) {
        toy t;
        toy_make(&t, (sdm_pod_type)type, 0);
        sdm_model *m = toy_open(&t);
        double *p;
        float *memory, single[315];
        void *scratch;
        assert_int_equal(SDM_ALLOC(&p, N * P, "parameters", NULL), 0);
        assert_int_equal(SDM_ALLOC(&memory, N * 315 + 2 * SIDE, "maps", NULL), 0);
        assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, N), 1, "scratch", NULL), 0);
        for (uint64_t i = 0; i < N; i++) random_params(i, p + i * P);
        for (size_t offset = 0; offset < 3; offset++) {
            float *maps = memory + SIDE + offset;
            for (size_t i = 0; i < N * 315 + 2 * SIDE; i++) memory[i] = 77;
            sdm_model_forward(m, p, N, maps, scratch);
            for (size_t i = 0; i < N; i += 37) {
                sdm_model_forward(m, p + i * P, 1, single, scratch);
                assert_memory_equal(single, maps + i * 315, sizeof single);
            }
            assert_true(maps[-1] == 77 && maps[N * 315] == 77);
        }
        sdm_free(scratch);
        sdm_free(memory);
        sdm_free(p);
        sdm_model_free(m);
        sdm_free(t.memory);
    }
}

// J * direction and J^T * adjoint equal the products with the full Jacobian.
static void products_check(const sdm_model *m, const double *p, uint64_t trial, const float *map,
                           const float *jacobian)
{
    double direction[P], gradient[P];
    float value[315], tangent[315], adjoint[315];
    void *forward, *reverse;
    assert_int_equal(sdm_alloc(&forward, sdm_model_jvp_scratch_bytes(m), 1, "scratch", NULL), 0);
    assert_int_equal(sdm_alloc(&reverse, sdm_model_vjp_scratch_bytes(m), 1, "scratch", NULL), 0);
    for (int i = 0; i < P; i++) direction[i] = sdm_rng_normal(3, trial, (uint64_t)i);
    for (int v = 0; v < 315; v++) adjoint[v] = (float)sdm_rng_normal(4, trial, (uint64_t)v);
    sdm_model_jvp(m, p, direction, value, tangent, forward);
    sdm_model_vjp(m, p, adjoint, gradient, reverse);
    for (int v = 0; v < 315; v++) {
        double want = 0, size = 0;
        for (int i = 0; i < P; i++) {
            want += direction[i] * jacobian[i * 315 + v];
            size += fabs(direction[i] * jacobian[i * 315 + v]);
        }
        assert_true(fabs(want - tangent[v]) < 1e-5 * (1 + size));
        assert_true(fabsf(value[v] - map[v]) < 1e-4f);
    }
    for (int i = 0; i < P; i++) {
        double want = 0, size = 0;
        for (int v = 0; v < 315; v++) {
            want += (double)adjoint[v] * jacobian[i * 315 + v];
            size += fabs((double)adjoint[v] * jacobian[i * 315 + v]);
        }
        assert_true(fabs(want - gradient[i]) < 1e-5 * (1 + size));
    }
    sdm_free(forward);
    sdm_free(reverse);
}

static void jacobian_is_the_slope(void **state)
{
    (void)state;
    // Without ReLU, whose derivative jumps at its kinks.
    for (int mode = 0; mode < 6; mode++) {
        const int activation = mode % 2;
        n_levels = 3 - (size_t)mode / 2;
        toy t;
        toy_make(&t, SDM_POD_F32, activation);
        sdm_model *m = toy_open(&t);
        void *scratch, *forward;
        float map[315], value[315], jacobian[P * 315];
        double p[P], up[315], down[315];
        assert_int_equal(
            sdm_alloc(&scratch, sdm_model_jacobian_scratch_bytes(m), 1, "scratch", NULL), 0);
        assert_int_equal(sdm_alloc(&forward, sdm_model_scratch_bytes(m, 1), 1, "scratch", NULL), 0);
        for (uint64_t trial = 0; trial < 5; trial++) {
            random_params(trial, p);
            sdm_model_jacobian(m, p, value, jacobian, scratch);
            sdm_model_forward(m, p, 1, map, forward);
            for (int v = 0; v < 315; v++) assert_true(fabsf(map[v] - value[v]) < 1e-4f);
            // Central differences of the reference in double.
            for (int i = 0; i < P; i++) {
                const double h = 1e-5, at = p[i];
                p[i] = at + h, reference(&t, p, up);
                p[i] = at - h, reference(&t, p, down);
                p[i] = at;
                for (int v = 0; v < 315; v++) {
                    const double slope = (up[v] - down[v]) / (2 * h);
                    assert_true(fabs(slope - jacobian[i * 315 + v]) < 1e-4 * (10 + fabs(slope)));
                }
            }
            products_check(m, p, trial, map, jacobian);
        }
        sdm_free(scratch);
        sdm_free(forward);
        sdm_model_free(m);
        sdm_free(t.memory);
    }
}

// Byte weights: the Jacobian is close to that of float weights, and sdm_model_vjp() agrees with it.
static void jacobian_of_bytes_with(size_t levels)
{
    n_levels = levels;
    toy t;
    toy_make(&t, SDM_POD_F32, 0);
    sdm_model *floats = toy_open(&t);
    t.spec.type = SDM_POD_I8;
    sdm_model *m = toy_open(&t);
    void *scratch, *reverse;
    static float value[315], want[P * 315], jacobian[P * 315], adjoint[315];
    double p[P], gradient[P];
    assert_int_equal(sdm_alloc(&scratch, sdm_model_jacobian_scratch_bytes(m), 1, "scratch", NULL),
                     0);
    assert_int_equal(sdm_alloc(&reverse, sdm_model_vjp_scratch_bytes(m), 1, "scratch", NULL), 0);
    assert_true(sdm_model_jacobian_scratch_bytes(m) >= sdm_model_jacobian_scratch_bytes(floats));
    for (uint64_t trial = 0; trial < 5; trial++) {
        random_params(trial, p);
        sdm_model_jacobian(floats, p, value, want, scratch);
        sdm_model_jacobian(m, p, value, jacobian, scratch);
        for (int v = 0; v < 315; v++) adjoint[v] = (float)sdm_rng_normal(4, trial, (uint64_t)v);
        sdm_model_vjp(m, p, adjoint, gradient, reverse);
        for (int i = 0; i < P; i++) {
            double wrong = 0, square = 0, sum = 0, size = 0;
            for (int v = 0; v < 315; v++) {
                const double x = jacobian[i * 315 + v], y = want[i * 315 + v];
                wrong += (x - y) * (x - y), square += y * y;
                sum += (double)adjoint[v] * x, size += fabs((double)adjoint[v] * x);
            }
            assert_true(wrong > 0 && wrong < 3e-5 * square);
            assert_true(fabs(sum - gradient[i]) < 1e-3 * size);
        }
    }
    sdm_free(reverse);
    sdm_free(scratch);
    sdm_model_free(m);
    sdm_model_free(floats);
    sdm_free(t.memory);
}

static void jacobian_of_bytes(void **state)
{
    (void)state;
    for (size_t levels = 1; levels <= 3; levels++) jacobian_of_bytes_with(levels);
}

// Byte weights: the Jacobian agrees with differences (of fourth order) of the map that
// sdm_model_jacobian() returns, and with sdm_model_vjp(), one voxel at a time. The tolerance covers
// the rounded inputs of the tangents; vjp works in floats.
static void jacobian_of_bytes_is_the_slope(void **state)
{
    (void)state;
    for (n_levels = 1; n_levels <= 3; n_levels++) {
        toy t;
        toy_make(&t, SDM_POD_I8, 0);
        sdm_model *m = toy_open(&t);
        void *scratch, *reverse;
        static float map[4][315], jacobian[P * 315], unused[P * 315], adjoint[315];
        double p[P], gradient[P];
        assert_int_equal(
            sdm_alloc(&scratch, sdm_model_jacobian_scratch_bytes(m), 1, "scratch", NULL), 0);
        assert_int_equal(sdm_alloc(&reverse, sdm_model_vjp_scratch_bytes(m), 1, "scratch", NULL),
                         0);
        for (uint64_t trial = 0; trial < 3; trial++) {
            double most[P] = {0};
            random_params(trial, p);
            sdm_model_jacobian(m, p, map[0], jacobian, scratch);
            for (int i = 0; i < P; i++)
                for (int v = 0; v < 315; v++) most[i] = fmax(most[i], fabsf(jacobian[i * 315 + v]));
            for (int i = 0; i < P; i++) {
                const double h = 2e-3 * (t.params[i].max - t.params[i].min), at = p[i];
                for (int k = 0; k < 4; k++) {
                    p[i] = at + (k < 2 ? k - 2 : k - 1) * h;
                    sdm_model_jacobian(m, p, map[k], unused, scratch);
                }
                p[i] = at;
                for (int v = 0; v < 315; v++) {
                    const double slope =
                        (map[0][v] - 8.0 * map[1][v] + 8.0 * map[2][v] - map[3][v]) / (12 * h);
                    assert_true(fabs(slope - jacobian[i * 315 + v]) < 2e-3 * most[i]);
                }
            }
            for (int v = 0; v < 315; v++) {
                memset(adjoint, 0, sizeof adjoint);
                adjoint[v] = 1;
                sdm_model_vjp(m, p, adjoint, gradient, reverse);
                for (int i = 0; i < P; i++)
                    assert_true(fabs(gradient[i] - jacobian[i * 315 + v]) < 2e-3 * most[i]);
            }
        }
        sdm_free(reverse);
        sdm_free(scratch);
        sdm_model_free(m);
        sdm_free(t.memory);
    }
    n_levels = 3;
}

// The map that comes with derivatives is a smooth function of the parameters; rounding steps would
// keep a fit from converging.
static void maps_with_derivatives_are_smooth(void **state)
{
    (void)state;
    for (n_levels = 1; n_levels <= 3; n_levels++) {
        toy t;
        toy_make(&t, SDM_POD_I8, 0);
        sdm_model *m = toy_open(&t);
        void *scratch;
        static float map[3][315], jacobian[P * 315], alone[315];
        double p[P];
        assert_int_equal(
            sdm_alloc(&scratch, sdm_model_jacobian_scratch_bytes(m), 1, "scratch", NULL), 0);
        for (uint64_t trial = 0; trial < 5; trial++) {
            random_params(trial, p);
            sdm_model_forward(m, p, 1, alone, scratch);
            for (int k = 0; k < 3; k++, p[0] += 1e-5)
                sdm_model_jacobian(m, p, map[k], jacobian, scratch);
            double rough = 0, size = 0, rounding = 0;
            for (int v = 0; v < 315; v++) {
                rough = fmax(rough, fabs((double)map[0][v] - 2.0 * map[1][v] + map[2][v]));
                rounding = fmax(rounding, fabs((double)map[0][v] - alone[v]));
                size = fmax(size, fabs(map[1][v]));
            }
            assert_true(rough < 5e-6 * size);
            assert_true(rounding > 0 && rounding < 4e-3 * size); // the plain map rounds its inputs
        }
        sdm_free(scratch);
        sdm_model_free(m);
        sdm_free(t.memory);
    }
    n_levels = 3;
}

// A parameter that is NaN must not give a finite map.
static void bytes_keep_what_is_not_finite(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, SDM_POD_I8, 0);
    sdm_model *m = toy_open(&t);
    void *scratch;
    float map[315];
    double p[P];
    int finite = 0;
    random_params(0, p);
    p[1] = NAN;
    assert_int_equal(sdm_alloc(&scratch, sdm_model_scratch_bytes(m, 1), 1, "scratch", NULL), 0);
    sdm_model_forward(m, p, 1, map, scratch);
    for (int v = 0; v < 315; v++) finite += isfinite(map[v]) != 0;
    assert_true(finite < 315);
    sdm_free(scratch);
    sdm_model_free(m);
    sdm_free(t.memory);
}

// A file with a weight that is NaN or infinite is refused, though its checksums are right.
static void weights_must_be_finite(void **state)
{
    (void)state;
    for (int type = SDM_POD_F32; type <= SDM_POD_I8; type++)
        for (int which = 0; which < 6; which++) {
            toy t;
            toy_make(&t, (sdm_pod_type)type, 0);
            (*(float *const[]){t.head, t.basis, t.layer[1]}[which / 2]) =
                which % 2 ? NAN : INFINITY;
            uint8_t *bytes;
            size_t size;
            sdm_model *m;
            sdm_error e = {0};
            assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, NULL), SDM_OK);
            assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, &e), SDM_E_FORMAT);
            assert_non_null(strstr(e.text, "is not finite"));
            assert_non_null(strstr(e.text, "of section 'pod."));
            sdm_free(bytes);
            sdm_free(t.memory);
        }
}

static void file_keeps_everything(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, SDM_POD_F16, 0);
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e;
    assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, &e), SDM_OK);
    char path[] = "model_XXXXXX";
    close(mkstemp(path));
    assert_int_equal(sdm_container_write(path, bytes, size, &e), SDM_OK);
    assert_int_equal(sdm_model_open(path, &m, &e), SDM_OK);
    const sdm_model_info *i = sdm_model_get_info(m);
    assert_string_equal(i->shape, "toy");
    assert_string_equal(i->kind, "pod");
    assert_string_equal(i->version, SDM_VERSION_TEXT);
    assert_string_equal(i->config, "seed: 77\n");
    assert_int_equal(i->n_params, P);
    assert_string_equal(i->params[2].name, "p2");
    assert_int_equal(sdm_model_param_index(m, "p2"), 2);
    assert_int_equal(sdm_model_param_index(m, "p"), -1);
    assert_int_equal(sdm_model_param_index(m, NULL), -1);
    assert_true(i->params[2].min == -3 && i->params[2].max == 4 && i->params[2].def == 0.5);
    assert_int_equal(i->n_options, 2);
    assert_string_equal(i->option_names[1], "ear");
    assert_string_equal(i->option_values[1], "left");
    assert_memory_equal(&i->grid, &t.info.grid, sizeof i->grid);
    assert_memory_equal(&i->accuracy, &t.info.accuracy, sizeof i->accuracy);
    assert_true(i->seed == 77 && i->train_seconds == 1.25 && i->train_samples == 1234 &&
                i->file_bytes == size);
    sdm_model_free(m);
    remove(path);
    assert_int_equal(sdm_model_open(path, &m, &e), SDM_E_IO);
    assert_null(m);
    sdm_free(bytes);
    sdm_free(t.memory);
}

/* Number of times that a word occurs in the bytes. */
static size_t count_word(const uint8_t *bytes, size_t size, const char *word)
{
    size_t n = 0;
    for (size_t i = 0; i + strlen(word) <= size; i++) n += !memcmp(bytes + i, word, strlen(word));
    return n;
}

// A normal distribution has a line in the description; without lines, as in files of the first
// versions, all parameters are uniform.
static void distributions_are_kept(void **state)
{
    (void)state;
    toy t;
    uint8_t *bytes;
    size_t size;
    sdm_model *m;
    sdm_error e = {0};
    for (int normal = 0; normal < 2; normal++) {
        toy_make(&t, SDM_POD_I8, 0);
        if (normal)
            t.params[1].distribution = (sdm_distribution){SDM_DISTRIBUTION_NORMAL, 0.1, 1.0 / 3};
        assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, &e), SDM_OK);
        assert_int_equal(count_word(bytes, size, "param.normal="), normal);
        assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, &e), SDM_OK);
        const sdm_model_info *i = sdm_model_get_info(m);
        for (int k = 0; k < P; k++) {
            const sdm_distribution *d = &i->params[k].distribution;
            assert_int_equal(d->kind,
                             normal && k == 1 ? SDM_DISTRIBUTION_NORMAL : SDM_DISTRIBUTION_UNIFORM);
            assert_true(d->kind == SDM_DISTRIBUTION_UNIFORM ||
                        (d->mean == 0.1 && d->deviation == 1.0 / 3));
            assert_true(i->params[k].def == 0.5);
        }
        sdm_model_free(m);
        sdm_free(bytes);
        sdm_free(t.memory);
    }
    // figures that no training writes
    const double bad[][2] = {{0, -1}, {0, 0}, {1e6, 1}, {0, 1e9}};
    for (size_t k = 0; k < sizeof bad / sizeof *bad; k++) {
        toy_make(&t, SDM_POD_F16, 0);
        t.params[2].distribution =
            (sdm_distribution){SDM_DISTRIBUTION_NORMAL, bad[k][0], bad[k][1]};
        assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, &e), SDM_OK);
        assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, &e), SDM_E_FORMAT);
        assert_non_null(
            strstr(e.text, "toy: damaged: the description lacks a valid 'param.normal'"));
        sdm_free(bytes);
        sdm_free(t.memory);
    }
}

// The survey weights coefficients by the distributions, but finds their extremes in the whole
// range. Latents 1 to 3 are sqrt(3) times the scaled parameters, in some order.
static void survey_follows_the_distributions(void **state)
{
    (void)state;
    toy t;
    survey s;
    toy_make(&t, SDM_POD_I8, 0);
    const double half = 0.5 * (t.params[1].max - t.params[1].min);
    t.params[1].distribution = (sdm_distribution){
        SDM_DISTRIBUTION_NORMAL, 0.5 * (t.params[1].max + t.params[1].min), 0.1 * half};
    assert_int_equal(sdm_pod_survey(&t.spec, &s, NULL), SDM_OK);
    const coefficient_stats *latent = s.stats + s.coefficients_at[t.spec.arch.levels.n];
    int n_uniform = 0, n_normal = 0;
    for (int k = 1; k <= P; k++) {
        // 256 samples: the relative error of a mean square is about 6 % (uniform), 9 % (normal)
        n_uniform += fabs(latent[k].square - 1) < 0.3;
        n_normal += fabs(latent[k].square - 0.03) < 0.3 * 0.03;
        assert_true(fabs(latent[k].largest - sqrt(3)) < 1e-6);
    }
    assert_true(n_uniform == P - 1 && n_normal == 1);
    sdm_pod_survey_dispose(&s);
    sdm_free(t.memory);
}

static void expect_refused(const uint8_t *bytes, size_t size, const char *what, size_t at)
{
    sdm_model *m = NULL;
    sdm_error e = {0};
    const sdm_status s = sdm_model_open_memory("damaged", bytes, size, &m, &e);
    if (s != SDM_E_FORMAT) fail_msg("%s at %zu gives status %d", what, at, s);
    assert_null(m);
    assert_memory_equal(e.text, "damaged: ", 9);
}

static void damage_is_refused_with(sdm_pod_type type)
{
    toy t;
    toy_make(&t, type, 0);
    uint8_t *bytes;
    size_t size;
    assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, NULL), SDM_OK);
    const size_t header = 24 + 8 * 48 + 8;
    // Truncation: at every byte of the header and at a sample of the others.
    for (size_t n = 0; n < size; n += n < header + 64 ? 1 : 97)
        expect_refused(bytes, n, "truncation", n);
    expect_refused(bytes, size - 1, "truncation", size - 1);
    // Flipped bits: all of the header, a sample of the sections, their gaps and the trailer.
    for (size_t i = 0; i < size; i += i < header + 64 || i > size - 10 ? 1 : 61)
        for (int bit = 0; bit < 8; bit++) {
            bytes[i] ^= (uint8_t)(1 << bit);
            expect_refused(bytes, size, "flipped bit", i);
            bytes[i] ^= (uint8_t)(1 << bit);
        }
    // Extra bytes after the end.
    uint8_t *longer;
    assert_int_equal(SDM_ALLOC(&longer, size + 64, "longer", NULL), 0);
    memcpy(longer, bytes, size);
    expect_refused(longer, size + 64, "longer", size);
    sdm_free(longer);
    // A newer version of the format is reported as such.
    sdm_error e;
    sdm_model *m;
    bytes[8] = SDM_CONTAINER_VERSION + 1;
    assert_int_equal(sdm_model_open_memory("new", bytes, size, &m, &e), SDM_E_FORMAT);
    assert_non_null(strstr(e.text, "newer"));
    bytes[8] = 1;
    assert_int_equal(sdm_model_open_memory("old", bytes, size, &m, &e), SDM_E_FORMAT);
    assert_non_null(strstr(e.text, "before the first release"));
    sdm_free(bytes);
    sdm_free(t.memory);
}

static void damage_is_refused(void **state)
{
    (void)state;
    damage_is_refused_with(SDM_POD_F16);
    damage_is_refused_with(SDM_POD_I8);
}

// Right checksums, but sizes far too large for the sections.
static void hostile_sections(void **state)
{
    (void)state;
    static const char meta[] =
        "kind=pod\nversion=0.1.0\nshape=x\ngrid.size=1048576 1048576 1048576\n";
    const sdm_section sections[] = {
        {"meta", meta, sizeof meta - 1}, {"config", "", 0}, {"pod.ranks", "", 0}};
    uint8_t *bytes;
    size_t size;
    assert_int_equal(sdm_container_build(sections, 3, &bytes, &size, NULL), SDM_OK);
    expect_refused(bytes, size, "hostile", 0);
    sdm_free(bytes);
    sdm_error e;
    assert_int_equal(sdm_container_build(sections, 0, &bytes, &size, &e), SDM_E_INTERNAL);
    const sdm_section long_name = {"a name of more than twenty-three bytes", "", 0};
    assert_int_equal(sdm_container_build(&long_name, 1, &bytes, &size, &e), SDM_E_INTERNAL);
    static const char checkpoint[] = "kind=checkpoint\n";
    const sdm_section parts[] = {{"meta", checkpoint, sizeof checkpoint - 1},
                                 {"checkpoint", "", 0}};
    sdm_model *m;
    assert_int_equal(sdm_container_build(parts, 2, &bytes, &size, NULL), SDM_OK);
    assert_int_equal(sdm_model_open_memory("c", bytes, size, &m, &e), SDM_E_FORMAT);
    assert_non_null(strstr(e.text, "--resume"));
    sdm_free(bytes);
}

static void every_allocation_may_fail_with(sdm_pod_type type)
{
    toy t;
    toy_make(&t, type, 0);
    uint8_t *bytes = NULL;
    size_t size = 0;
    sdm_error e;
    sdm_status s = SDM_E_NOMEM;
    unsigned long n = 1;
    // Building the file.
    for (; s; n++) {
        sdm_alloc_fail_after(n);
        s = sdm_pod_build(&t.spec, &bytes, &size, &e);
        if (s) assert_int_equal(s, SDM_E_NOMEM);
        assert_true(n < 100);
    }
    sdm_alloc_fail_after(0);
    assert_true(n > 4);
    sdm_model *m = NULL;
    s = SDM_E_NOMEM;
    // Opening the model.
    for (n = 1; s; n++) {
        sdm_alloc_fail_after(n);
        s = sdm_model_open_memory("toy", bytes, size, &m, &e);
        if (s) assert_int_equal(s, SDM_E_NOMEM);
        assert_true(n < 100);
    }
    sdm_alloc_fail_after(0);
    assert_true(n > 6);
    sdm_model_free(m);
    sdm_model_free(NULL);
    sdm_free(bytes);
    sdm_free(t.memory);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    every_allocation_may_fail_with(SDM_POD_F32);
    every_allocation_may_fail_with(SDM_POD_I8);
}

// The verdict of the training is kept; without one the file has no section for it, as the files of
// earlier versions.
static void quality_is_kept(void **state)
{
    (void)state;
    toy t;
    toy_make(&t, SDM_POD_F32, 0);
    sdm_model *m = toy_open(&t);
    const sdm_model_quality *q = &sdm_model_get_info(m)->quality;
    const size_t without = sdm_model_get_info(m)->file_bytes;
    assert_true(!*q->grade && isnan(q->cut) && isnan(q->between_mm));
    sdm_model_free(m);
    t.info.quality = (sdm_model_quality){"poor", 0.25, NAN};
    m = toy_open(&t);
    q = &sdm_model_get_info(m)->quality;
    assert_string_equal(q->grade, "poor");
    assert_true(q->cut == 0.25 && isnan(q->between_mm));
    assert_true(sdm_model_get_info(m)->file_bytes > without);
    sdm_model_free(m);
    // an unknown grade and an impossible share are damage
    const sdm_model_quality wrong[] = {{"fine", 0, 0}, {"good", 1.5, 0}, {"good", 0, -1}};
    for (size_t i = 0; i < 3; i++) {
        uint8_t *bytes;
        size_t size;
        t.info.quality = wrong[i];
        assert_int_equal(sdm_pod_build(&t.spec, &bytes, &size, NULL), SDM_OK);
        assert_int_equal(sdm_model_open_memory("toy", bytes, size, &m, NULL), SDM_E_FORMAT);
        sdm_free(bytes);
    }
    sdm_free(t.memory);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(polynomials_match_closed_forms),
        cmocka_unit_test(forward_is_the_definition),
        cmocka_unit_test(partial_panels_stay_inside_their_map),
        cmocka_unit_test(many_maps_equal_single_maps),
        cmocka_unit_test(jacobian_is_the_slope),
        cmocka_unit_test(jacobian_of_bytes),
        cmocka_unit_test(jacobian_of_bytes_is_the_slope),
        cmocka_unit_test(bytes_keep_what_is_not_finite),
        cmocka_unit_test(weights_must_be_finite),
        cmocka_unit_test(maps_with_derivatives_are_smooth),
        cmocka_unit_test(file_keeps_everything),
        cmocka_unit_test(distributions_are_kept),
        cmocka_unit_test(quality_is_kept),
        cmocka_unit_test(survey_follows_the_distributions),
        cmocka_unit_test(damage_is_refused),
        cmocka_unit_test(hostile_sections),
        cmocka_unit_test(every_allocation_may_fail),
    };
    int failed = 0;
    for (int level = sdm_processor_select(-1); level >= 0; level--) {
        sdm_processor_select(level);
        for (block = 2; block <= 4; block += 2)
            failed += cmocka_run_group_tests_name(sdm_kernels_name(), tests, NULL, NULL);
    }
    return failed;
}
