/* Derivatives of the maps of the pod network against differences, and their bits on every
 * instruction set.
 * Tests: pod_decode_back.c pod_forward.c pod_latent.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pod_toy.h"

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
    n_levels = 3;
}

enum { SEVEN = 7 };

/* Of a model file with the kernels of one level: seven maps, the Jacobian of the first one and its
 * derivative along a direction. */
typedef struct outputs {
    float maps[SEVEN * 315], value[315], jacobian[P * 315], along[315], tangent[315];
} outputs;

static void outputs_at(const uint8_t *file, size_t size, int level, outputs *o)
{
    sdm_model *m;
    sdm_processor_select(level);
    assert_int_equal(sdm_model_open_memory("toy", file, size, &m, NULL), SDM_OK);
    const size_t bytes[] = {sdm_model_scratch_bytes(m, SEVEN), sdm_model_jacobian_scratch_bytes(m),
                            sdm_model_jvp_scratch_bytes(m)};
    double p[SEVEN * P];
    void *scratch;
    for (int i = 0; i < SEVEN; i++) random_params((uint64_t)i, p + i * P);
    assert_int_equal(sdm_alloc(&scratch, bytes[0] + bytes[1] + bytes[2], 1, "scratch", NULL), 0);
    sdm_model_forward(m, p, SEVEN, o->maps, scratch);
    sdm_model_jacobian(m, p, o->value, o->jacobian, scratch);
    sdm_model_jvp(m, p, (const double[P]){0.3, -1, 0.7}, o->along, o->tangent, scratch);
    sdm_free(scratch);
    sdm_model_free(m);
    sdm_processor_select(-1);
}

// Integer weights: maps and derivatives have the bits of the baseline on every instruction set.
static void bytes_have_the_same_bits_everywhere(void **state)
{
    (void)state;
    static outputs here, baseline;
    for (int mode = 0; mode < 12; mode++) {
        n_levels = 1 + (size_t)mode / 4;
        toy t;
        uint8_t *file;
        size_t size;
        toy_make(&t, SDM_POD_I8, mode % 4);
        assert_int_equal(sdm_pod_build(&t.spec, &file, &size, NULL), SDM_OK);
        outputs_at(file, size, SDM_PROCESSOR_BASELINE, &baseline);
        for (int level = sdm_processor_select(-1); level > SDM_PROCESSOR_BASELINE; level--) {
            outputs_at(file, size, level, &here);
            assert_memory_equal(&here, &baseline, sizeof here);
        }
        sdm_free(file);
        sdm_free(t.memory);
    }
    n_levels = 3;
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(jacobian_is_the_slope),
        cmocka_unit_test(jacobian_of_bytes),
        cmocka_unit_test(bytes_have_the_same_bits_everywhere),
        cmocka_unit_test(jacobian_of_bytes_is_the_slope),
        cmocka_unit_test(maps_with_derivatives_are_smooth),
    };
    return toy_run(tests);
}
