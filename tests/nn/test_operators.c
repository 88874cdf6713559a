/* Operators on feature maps against plain loops in double: with every instruction set of this
 * machine, the same bits for any number of threads, and zeros kept in the gaps around the maps.
 * Tests: conv.c conv_kernels_avx2.c conv_kernels_avx512.c conv_kernels_generic.c dense.c
 * dropout.c pool.c upsample.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "feature_maps.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/processor.h"
#include "sdmnn/conv.h"
#include "sdmnn/operators.h"

static const size_t GRIDS[][3] = {{1, 1, 1}, {2, 1, 3},  {5, 4, 3},
                                  {6, 6, 4}, {17, 9, 6}, {30, 25, 7}};
enum { N_GRIDS = sizeof GRIDS / sizeof *GRIDS };

typedef struct volume {
    size_t n[3];
    size_t channels;
    const double *v; /* v[channels][z][y][x] */
} volume;

// Value of a voxel; zero outside of the volume.
static double volume_at(const volume *m, size_t c, long x, long y, long z)
{
    if (x < 0 || y < 0 || z < 0 || x >= (long)m->n[0] || y >= (long)m->n[1] || z >= (long)m->n[2])
        return 0;
    return m->v[((c * m->n[2] + (size_t)z) * m->n[1] + (size_t)y) * m->n[0] + (size_t)x];
}

static float activated(int kind, float x, float *slope)
{
    float y = x;
    *slope = 1;
    if (kind >= 0) sdm_activate(kind, 1, &x, &y, slope);
    return y;
}

static void conv_check(const size_t n[3], sdm_conv c, int activation)
{
    const sdm_fmap g = sdm_fmap_layout(n);
    const size_t weights = c.in * c.out * c.taps;
    maps x = maps_random(&g, c.in, 1), y = maps_new(&g, c.out), slope = maps_new(&g, c.out);
    float *w = floats_random(weights, 2), *bias = floats_random(c.out, 3),
          *packed = floats_random(sdm_conv_packed_count(c), 9);
    sdm_conv_pack(c, false, w, packed);
    double *in = maps_to_double(&x);
    const volume m = {{n[0], n[1], n[2]}, c.in, in};
    for (int threads = 1; threads <= 3; threads++) {
        maps again = maps_new(&g, c.out);
        sdm_conv_apply(&g, c, packed, x.at, (sdm_conv_finish){bias, activation, slope.at}, again.at,
                       threads);
        if (threads == 1) memcpy(y.memory, again.memory, maps_bytes(&y));
        assert_memory_equal(y.memory, again.memory, maps_bytes(&y));
        maps_free(&again);
    }
    const double bound = 1e-6 * sqrt((double)(c.in * c.taps)) + 1e-6;
    for (size_t o = 0; o < c.out; o++)
        for (size_t i = 0; i < n[0] * n[1] * n[2]; i++) {
            const long px = (long)(i % n[0]), py = (long)(i / n[0] % n[1]),
                       pz = (long)(i / n[0] / n[1]);
            double s = (double)bias[o];
            for (size_t k = 0; k < c.in; k++)
                for (long t = 0; t < (long)c.taps; t++) {
                    const long d = c.taps == 27 ? 1 : 0;
                    s += (double)w[(o * c.in + k) * c.taps + (size_t)t] *
                         volume_at(&m, k, px + t % 3 - d, py + t / 3 % 3 - d, pz + t / 9 - d);
                }
            float ds;
            const float want = activated(activation, (float)s, &ds);
            assert_true(fabs((double)want - (double)*maps_voxel(&y, o, i)) <= bound);
            if (activation == 0)
                assert_true(fabs((double)ds - (double)*maps_voxel(&slope, o, i)) <= bound);
        }
    maps_check_zeros(&y);
    maps_free(&x), maps_free(&y), maps_free(&slope);
    sdm_free(w), sdm_free(bias), sdm_free(packed), sdm_free(in);
}

static const sdm_conv CONVS[] = {{1, 1, 27}, {3, 5, 27},  {8, 8, 27}, {17, 4, 27},
                                 {5, 9, 1},  {16, 40, 1}, {250, 3, 1}};
enum { N_CONVS = sizeof CONVS / sizeof *CONVS };

static void convolution_matches_plain_loops(void **state)
{
    (void)state;
    for (size_t i = 0; i < N_GRIDS; i++)
        for (size_t k = 0; k < N_CONVS; k++) conv_check(GRIDS[i], CONVS[k], (int)((i + k) % 4) - 1);
}

// The transposed convolution is the adjoint: <dy, conv x> = <conv^T dy, x>. Each weight's gradient
// matches its sum.
static void convolution_gradients_match(void **state)
{
    (void)state;
    for (size_t q = 0; q < N_GRIDS * N_CONVS; q++) {
        const size_t *n = GRIDS[q / N_CONVS];
        const sdm_conv c = CONVS[q % N_CONVS], opposite = sdm_conv_opposite(c);
        const sdm_fmap g = sdm_fmap_layout(n);
        const size_t weights = c.in * c.out * c.taps, voxels = n[0] * n[1] * n[2];
        maps x = maps_random(&g, c.in, 1), dy = maps_random(&g, c.out, 2), dx = maps_new(&g, c.in);
        float *w = floats_random(weights, 2),
              *packed = floats_random(sdm_conv_packed_count(opposite), 9),
              *dw = floats_random(weights, 4), *db = floats_random(c.out, 5),
              *first = floats_random(weights, 4);
        sdm_conv_pack(c, true, w, packed);
        sdm_conv_apply(&g, opposite, packed, dy.at, (sdm_conv_finish){NULL, -1, NULL}, dx.at, 1);
        maps_check_zeros(&dx);
        sdm_conv_gradient(&g, c, x.at, dy.at, dw, db, 1);
        for (int threads = 2; threads <= 3; threads++) {
            float *more = floats_random(weights, 4), *bias = floats_random(c.out, 5);
            sdm_conv_gradient(&g, c, x.at, dy.at, more, bias, threads);
            assert_memory_equal(more, dw, weights * sizeof *dw);
            assert_memory_equal(bias, db, c.out * sizeof *db);
            sdm_free(more), sdm_free(bias);
        }
        double *in = maps_to_double(&x), *out = maps_to_double(&dy);
        const volume mx = {{n[0], n[1], n[2]}, c.in, in}, my = {{n[0], n[1], n[2]}, c.out, out};
        const long d = c.taps == 27 ? 1 : 0;
        const double bound = 1e-6 * sqrt((double)voxels) + 1e-6;
        for (size_t i = 0; i < weights; i++) {
            const size_t o = i / c.taps / c.in, k = i / c.taps % c.in;
            const long t = (long)(i % c.taps);
            double s = (double)first[i];
            for (size_t v = 0; v < voxels; v++) {
                const long px = (long)(v % n[0]), py = (long)(v / n[0] % n[1]),
                           pz = (long)(v / n[0] / n[1]);
                s += volume_at(&my, o, px, py, pz) *
                     volume_at(&mx, k, px + t % 3 - d, py + t / 3 % 3 - d, pz + t / 9 - d);
            }
            assert_true(fabs(s - (double)dw[i]) <= bound);
        }
        for (size_t v = 0; v < voxels; v++) {
            const long px = (long)(v % n[0]), py = (long)(v / n[0] % n[1]),
                       pz = (long)(v / n[0] / n[1]);
            for (size_t k = 0; k < c.in; k += 3) {
                double s = 0;
                for (size_t o = 0; o < c.out; o++)
                    for (long t = 0; t < (long)c.taps; t++)
                        s += (double)w[(o * c.in + k) * c.taps + (size_t)t] *
                             volume_at(&my, o, px - t % 3 + d, py - t / 3 % 3 + d, pz - t / 9 + d);
                assert_true(fabs(s - (double)*maps_voxel(&dx, k, v)) <=
                            1e-6 * sqrt((double)(c.out * c.taps)) + 1e-6);
            }
        }
        for (size_t o = 0; o < c.out; o++) {
            float *was = floats_random(c.out, 5);
            double s = (double)was[o];
            for (size_t v = 0; v < voxels; v++) s += out[o * voxels + v];
            assert_true(fabs(s - (double)db[o]) <= bound);
            sdm_free(was);
        }
        maps_free(&x), maps_free(&dy), maps_free(&dx);
        sdm_free(w), sdm_free(packed), sdm_free(dw), sdm_free(db), sdm_free(first), sdm_free(in),
            sdm_free(out);
    }
}

static size_t half(size_t n) { return (n + 1) / 2; }

static void pooling_takes_the_largest(void **state)
{
    (void)state;
    enum { C = 3 };
    for (size_t q = 0; q < N_GRIDS; q++) {
        const size_t *n = GRIDS[q], m[3] = {half(n[0]), half(n[1]), half(n[2])};
        const sdm_fmap g = sdm_fmap_layout(n), h = sdm_fmap_layout(m);
        maps x = maps_random(&g, C, 1), y = maps_new(&h, C), dx = maps_random(&g, C, 2),
             dy = maps_new(&h, C), back = maps_random(&g, C, 3), before = maps_random(&g, C, 3);
        sdm_pool_forward(&g, &h, C, x.at, y.at, 2);
        sdm_pool_tangent(&g, &h, C, x.at, dx.at, dy.at, 2);
        sdm_pool_backward(&g, &h, C, x.at, y.at, back.at, 2);
        maps_check_zeros(&y), maps_check_zeros(&dy), maps_check_zeros(&back);
        for (size_t c = 0; c < C; c++)
            for (size_t v = 0; v < m[0] * m[1] * m[2]; v++) {
                float best = -INFINITY, slope = 0, sum = 0;
                for (size_t k = 0; k < 8; k++) {
                    const size_t px = 2 * (v % m[0]) + k % 2,
                                 py = 2 * (v / m[0] % m[1]) + k / 2 % 2,
                                 pz = 2 * (v / m[0] / m[1]) + k / 4;
                    if (px >= n[0] || py >= n[1] || pz >= n[2]) continue;
                    const size_t i = (pz * n[1] + py) * n[0] + px;
                    const float value = *maps_voxel(&x, c, i);
                    if (value > best) best = value, slope = *maps_voxel(&dx, c, i);
                    sum += *maps_voxel(&back, c, i) - *maps_voxel(&before, c, i);
                }
                assert_true(*maps_voxel(&y, c, v) == best && *maps_voxel(&dy, c, v) == slope);
                assert_true(fabsf(sum - best) < 1e-5f);
            }
        maps_free(&x), maps_free(&y), maps_free(&dx), maps_free(&dy), maps_free(&back),
            maps_free(&before);
    }
}

static void upsampling_and_its_gradient_match(void **state)
{
    (void)state;
    enum { C = 2 };
    for (size_t q = 0; q < N_GRIDS * 3; q++) {
        const size_t *n = GRIDS[q / 3], f = q % 3 + 1;
        const size_t m[3] = {(n[0] + f - 1) / f, (n[1] + f - 1) / f, (n[2] + f - 1) / f};
        const sdm_fmap g = sdm_fmap_layout(n), h = sdm_fmap_layout(m);
        maps x = maps_random(&h, C, 1), y = maps_new(&g, C), dy = maps_random(&g, C, 2),
             dx = maps_random(&h, C, 3);
        sdm_upsample_forward(&g, &h, f, C, x.at, y.at, 2);
        sdm_upsample_backward(&g, &h, f, C, dy.at, dx.at, 2);
        maps_check_zeros(&y), maps_check_zeros(&dx);
        for (size_t c = 0; c < C; c++) {
            double sums[30 * 25 * 7] = {0};
            for (size_t v = 0; v < n[0] * n[1] * n[2]; v++) {
                const size_t to =
                    (v / n[0] / n[1] / f * m[1] + v / n[0] % n[1] / f) * m[0] + v % n[0] / f;
                assert_true(*maps_voxel(&y, c, v) == *maps_voxel(&x, c, to));
                sums[to] += (double)*maps_voxel(&dy, c, v);
            }
            for (size_t v = 0; v < m[0] * m[1] * m[2]; v++)
                assert_true(fabs(sums[v] - (double)*maps_voxel(&dx, c, v)) < 1e-5);
        }
        maps_free(&x), maps_free(&y), maps_free(&dx), maps_free(&dy);
    }
}

static void dropout_keeps_its_share_and_bits(void **state)
{
    (void)state;
    enum { C = 6 };
    const size_t n[3] = {19, 11, 13}, voxels = 19 * 11 * 13;
    const sdm_fmap g = sdm_fmap_layout(n);
    maps first = maps_random(&g, C, 1);
    // Pass 1 repeats pass 0, pass 2 uses other random numbers, pass 3 three threads.
    for (int pass = 0; pass < 4; pass++) {
        maps y = maps_random(&g, C, 1), slope = maps_random(&g, C, 2), was = maps_random(&g, C, 2);
        sdm_dropout(&g, C, 0.3, 5, 6, pass == 2 ? sdm_dropout_draws(&g, C) : 0, y.at, slope.at,
                    pass == 3 ? 3 : 1);
        size_t dropped = 0, same = 0;
        for (size_t i = 0; i < C * voxels; i++) {
            const float v = *maps_voxel(&y, i / voxels, i % voxels),
                        s = *maps_voxel(&slope, i / voxels, i % voxels);
            const float old = *maps_voxel(&was, i / voxels, i % voxels);
            dropped += v == 0;
            assert_true((v == 0) == (s == 0) && (s == 0 || fabsf(s * 0.7f / old - 1) < 1e-6f));
            same += v == *maps_voxel(&first, i / voxels, i % voxels);
        }
        assert_true(fabs((double)dropped / (double)(C * voxels) - 0.3) < 0.015);
        if (pass == 1 || pass == 3) assert_int_equal(same, C * voxels);
        // Independent masks agree with probability 0.7^2 + 0.3^2 = 0.58.
        if (pass == 2) assert_true(same < C * voxels * 65 / 100);
        maps_check_zeros(&y);
        if (pass == 0) memcpy(first.memory, y.memory, maps_bytes(&y));
        maps_free(&y), maps_free(&slope), maps_free(&was);
    }
    maps_free(&first);
}

static void dense_layer_matches_plain_loops(void **state)
{
    (void)state;
    enum { B = 3, I = 7, O = 5 };
    float *w = floats_random(O * I, 1), *bias = floats_random(O, 2), *x = floats_random(B * I, 3),
          *dy = floats_random(B * O, 4), *dw = floats_random(O * I, 5),
          *was = floats_random(O * I, 5), y[B * O], dx[B * I], db[O] = {1, 2, 3, 4, 5};
    sdm_dense_forward(B, I, O, w, bias, x, y, 2);
    sdm_dense_backward(B, I, O, w, x, dy, dw, db, dx, 2);
    for (int b = 0; b < B; b++) {
        for (int o = 0; o < O; o++) {
            double s = (double)bias[o];
            for (int i = 0; i < I; i++) s += (double)w[o * I + i] * (double)x[b * I + i];
            assert_true(fabs(s - (double)y[b * O + o]) < 1e-6);
        }
        for (int i = 0; i < I; i++) {
            double s = 0;
            for (int o = 0; o < O; o++) s += (double)w[o * I + i] * (double)dy[b * O + o];
            assert_true(fabs(s - (double)dx[b * I + i]) < 1e-6);
        }
    }
    for (int o = 0; o < O; o++) {
        double sum = o + 1;
        for (int b = 0; b < B; b++) sum += (double)dy[b * O + o];
        assert_true(fabs(sum - (double)db[o]) < 1e-6);
        for (int i = 0; i < I; i++) {
            double s = (double)was[o * I + i];
            for (int b = 0; b < B; b++) s += (double)dy[b * O + o] * (double)x[b * I + i];
            assert_true(fabs(s - (double)dw[o * I + i]) < 1e-6);
        }
    }
    sdm_dense_forward(B, I, O, w, NULL, x, y, 1);
    double s = 0;
    for (int i = 0; i < I; i++) s += (double)w[i] * (double)x[i];
    assert_true(fabs(s - (double)y[0]) < 1e-6);
    sdm_free(w), sdm_free(bias), sdm_free(x), sdm_free(dy), sdm_free(dw), sdm_free(was);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(convolution_matches_plain_loops),
                                       cmocka_unit_test(convolution_gradients_match),
                                       cmocka_unit_test(pooling_takes_the_largest),
                                       cmocka_unit_test(upsampling_and_its_gradient_match),
                                       cmocka_unit_test(dropout_keeps_its_share_and_bits),
                                       cmocka_unit_test(dense_layer_matches_plain_loops)};
    int failed = 0;
    for (int level = sdm_processor_select(-1); level >= 0; level--) {
        sdm_processor_select(level);
        failed += cmocka_run_group_tests_name(sdm_kernels_name(), tests, NULL, NULL);
    }
    return failed;
}
