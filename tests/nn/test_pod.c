/* Maps of the pod network against plain double arithmetic.
 * Tests: pod_build.c pod_decode.c pod_forward.c pod_latent.c pod_slabs.c polynomial.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "pod_toy.h"

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
    n_levels = 3;
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
    n_levels = 1;
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(polynomials_match_closed_forms),
        cmocka_unit_test(forward_is_the_definition),
        cmocka_unit_test(partial_panels_stay_inside_their_map),
        cmocka_unit_test(many_maps_equal_single_maps),
        cmocka_unit_test(bytes_keep_what_is_not_finite),
    };
    return toy_run(tests);
}
