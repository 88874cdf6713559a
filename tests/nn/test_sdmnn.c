/* The sdmnn network: maps and derivatives against its definition in plain double loops.
 * Tests: fmap.c model_kind.c passes.c sdmnn_run.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/model_threads.h"
#include "sdm/internal/pod.h"
#include "sdmnn_toy.h"

enum { LEVELS = 3 };

// A feature map of the reference: v[channels][z][y][x].
typedef struct volume {
    long n[3];
    long channels;
    double v[16 * VOXELS];
} volume;

static double *voxel(volume *m, long c, long x, long y, long z)
{
    return &m->v[((c * m->n[2] + z) * m->n[1] + y) * m->n[0] + x];
}

static double activate(int kind, double x)
{
    return kind == 0 ? x / (1 + exp(-x)) : kind == 1 ? tanh(x) : x > 0 ? x : 0;
}

// Convolution with edge^3 taps; reads its weights at *w and advances *w. activation -1: none.
static void convolve(volume *in, long outputs, long edge, int activation, const float **w,
                     volume *out)
{
    const long *n = in->n, d = edge / 2, taps = edge * edge * edge;
    memcpy(out->n, n, sizeof out->n);
    out->channels = outputs;
    const float *bias = *w + outputs * in->channels * taps;
    for (long o = 0; o < outputs; o++)
        for (long i = 0; i < n[0] * n[1] * n[2]; i++) {
            const long x = i % n[0], y = i / n[0] % n[1], z = i / n[0] / n[1];
            double s = (double)bias[o];
            for (long c = 0; c < in->channels; c++)
                for (long t = 0; t < taps; t++) {
                    const long a = x + t % edge - d, b = y + t / edge % edge - d,
                               k = z + t / edge / edge - d;
                    if (a < 0 || b < 0 || k < 0 || a >= n[0] || b >= n[1] || k >= n[2]) continue;
                    s += (double)(*w)[(o * in->channels + c) * taps + t] * *voxel(in, c, a, b, k);
                }
            *voxel(out, o, x, y, z) = activation < 0 ? s : activate(activation, s);
        }
    *w = bias + outputs;
}

static void pool(volume *in, volume *out)
{
    for (int a = 0; a < 3; a++) out->n[a] = (in->n[a] + 1) / 2;
    out->channels = in->channels;
    for (long c = 0; c < in->channels; c++) {
        for (long i = 0; i < out->n[0] * out->n[1] * out->n[2]; i++)
            out->v[c * out->n[0] * out->n[1] * out->n[2] + i] = -1e9;
        for (long z = 0; z < in->n[2]; z++)
            for (long y = 0; y < in->n[1]; y++)
                for (long x = 0; x < in->n[0]; x++) {
                    double *to = voxel(out, c, x / 2, y / 2, z / 2);
                    *to = fmax(*to, *voxel(in, c, x, y, z));
                }
    }
}

// Appends the channels of `low`, up-sampled by `factor`, to those of `to`.
static void append_upsampled(volume *low, long factor, volume *to)
{
    for (long c = 0; c < low->channels; c++, to->channels++)
        for (long z = 0; z < to->n[2]; z++)
            for (long y = 0; y < to->n[1]; y++)
                for (long x = 0; x < to->n[0]; x++)
                    *voxel(to, to->channels, x, y, z) =
                        *voxel(low, c, x / factor, y / factor, z / factor);
}

// The network as sdm/sdmnn.h defines it, in double.
static void reference(const toy *t, const double *p, double *map)
{
    static volume cells, down[LEVELS], a, b;
    const sdm_sdmnn_arch *k = &t->spec.arch;
    const float *w = t->weights;
    double h[70];
    for (size_t o = 0; o < k->width; o++) {
        double s = (double)w[k->width * P + o];
        for (size_t i = 0; i < P; i++)
            s += (double)w[o * P + i] *
                 (2 * (p[i] - t->params[i].min) / (t->params[i].max - t->params[i].min) - 1);
        h[o] = activate(k->activation, s);
    }
    w += k->width * (P + 1);
    cells = (volume){.n = {4, 2, 3}, .channels = 1};
    const float *bias = w + 24 * k->width;
    for (size_t i = 0; i < 24; i++) {
        cells.v[i] = (double)bias[i];
        for (size_t o = 0; o < k->width; o++) cells.v[i] += (double)w[i * k->width + o] * h[o];
    }
    w = bias + 24;
    b = (volume){.n = {11, 6, 7}};
    append_upsampled(&cells, 3, &b);
    for (int l = 0; l < LEVELS; l++) {
        convolve(&b, 4 << l, 3, k->activation, &w, &a);
        convolve(&a, 4 << l, 3, k->activation, &w, &down[l]);
        if (l < 2) pool(&down[l], &b);
    }
    a = down[2];
    for (int l = 1; l >= 0; l--) {
        convolve(&a, 4 << l, 1, k->activation, &w, &b);
        append_upsampled(&b, 2, &down[l]);
        convolve(&down[l], 4 << l, 3, k->activation, &w, &b);
        convolve(&b, 4 << l, 3, k->activation, &w, &a);
    }
    convolve(&a, 1, 1, -1, &w, &b);
    assert_int_equal(w - t->weights, t->n);
    memcpy(map, b.v, VOXELS * sizeof *map);
}

static void random_params(uint64_t index, double *p)
{
    for (int i = 0; i < P; i++)
        p[i] = -1.0 - i + (3.0 + 2 * i) * sdm_rng_uniform(5, 5, index * P + (uint64_t)i);
}

static void *scratch_of(size_t bytes)
{
    void *s;
    assert_int_equal(sdm_alloc(&s, bytes, 1, "scratch", NULL), SDM_OK);
    // NaN everywhere: a value that is read before it is written spoils the result
    memset(s, 0xff, bytes);
    return s;
}

static double largest(const double *v)
{
    double s = 0;
    for (int i = 0; i < VOXELS; i++) s = fmax(s, fabs(v[i]));
    return s;
}

static void forward_is_the_definition(void **state)
{
    (void)state;
    for (int mode = 0; mode < 6; mode++) {
        toy t;
        toy_make(&t, mode & 1, mode / 2);
        sdm_model *m = toy_open(&t);
        void *scratch = scratch_of(sdm_model_scratch_bytes(m, 2));
        double p[2 * P], truth[VOXELS];
        float maps[2 * VOXELS], again[2 * VOXELS];
        for (uint64_t i = 0; i < 2; i++) random_params(i, p + i * P);
        assert_true(sdm_model_is_threaded(m));
        sdm_model_forward(m, p, 2, maps, scratch);
        for (int i = 0; i < 2; i++) {
            reference(&t, p + i * P, truth);
            for (int v = 0; v < VOXELS; v++)
                assert_true(fabs(truth[v] - (double)maps[i * VOXELS + v]) < 1e-5 * largest(truth));
        }
        for (int threads = 2; threads <= 3; threads++) {
            sdm_model_forward_threads(m, p, 2, again, scratch, threads);
            assert_memory_equal(maps, again, sizeof maps);
        }
        // The trainer's form of the network gives the same map.
        sdm_sdmnn *net;
        float x[P];
        assert_int_equal(sdm_sdmnn_create(&t.spec.arch, 0, NULL, &net, NULL), SDM_OK);
        sdm_sdmnn_set(net, t.weights);
        for (int i = 0; i < P; i++)
            x[i] = (float)(2 * (p[i] - t.params[i].min) / (t.params[i].max - t.params[i].min) - 1);
        sdm_sdmnn_forward(net, x, again, 2);
        for (int v = 0; v < VOXELS; v++)
            assert_true(fabs((double)again[v] - (double)maps[v]) < 1e-5 * largest(truth));
        sdm_sdmnn_free(net);
        sdm_free(scratch);
        sdm_model_free(m);
        sdm_free(t.weights);
    }
}

static void jacobian_is_the_slope(void **state)
{
    (void)state;
    // Without ReLU, whose derivative jumps at its kinks.
    for (int activation = 0; activation < 2; activation++) {
        toy t;
        toy_make(&t, activation, activation);
        sdm_model *m = toy_open(&t);
        void *scratch = scratch_of(sdm_model_jacobian_scratch_bytes(m));
        static float value[VOXELS], jacobian[P * VOXELS], again[P * VOXELS];
        double p[P], truth[VOXELS], up[VOXELS], down[VOXELS];
        random_params(9, p);
        sdm_model_jacobian(m, p, value, jacobian, scratch);
        sdm_model_jacobian_threads(m, p, value, again, scratch, 3);
        assert_memory_equal(jacobian, again, sizeof again);
        reference(&t, p, truth);
        for (int v = 0; v < VOXELS; v++)
            assert_true(fabs(truth[v] - (double)value[v]) < 1e-5 * largest(truth));
        for (int i = 0; i < P; i++) {
            const double h = 1e-6, at = p[i];
            p[i] = at + h, reference(&t, p, up);
            p[i] = at - h, reference(&t, p, down);
            p[i] = at;
            for (int v = 0; v < VOXELS; v++)
                assert_true(fabs((up[v] - down[v]) / (2 * h) - (double)jacobian[i * VOXELS + v]) <
                            1e-4 * largest(truth));
        }
        // J * direction and J^T * adjoint against the full Jacobian.
        const double direction[P] = {0.4, -1.1, 0.7};
        double gradient[P];
        float adjoint[VOXELS];
        void *one = scratch_of(sdm_model_jvp_scratch_bytes(m)),
             *other = scratch_of(sdm_model_vjp_scratch_bytes(m));
        sdm_model_jvp(m, p, direction, value, again, one);
        for (int v = 0; v < VOXELS; v++) {
            double s = 0;
            for (int i = 0; i < P; i++) s += direction[i] * (double)jacobian[i * VOXELS + v];
            assert_true(fabs(s - (double)again[v]) < 1e-5 * largest(truth));
            assert_true(fabs(truth[v] - (double)value[v]) < 1e-5 * largest(truth));
            adjoint[v] = (float)sdm_rng_normal(8, 8, (uint64_t)v);
        }
        sdm_model_vjp(m, p, adjoint, gradient, other);
        for (int i = 0; i < P; i++) {
            double s = 0;
            for (int v = 0; v < VOXELS; v++)
                s += (double)adjoint[v] * (double)jacobian[i * VOXELS + v];
            assert_true(fabs(s - gradient[i]) < 1e-5 * largest(truth) * sqrt(VOXELS));
        }
        sdm_free(one), sdm_free(other);
        sdm_free(scratch);
        sdm_model_free(m);
        sdm_free(t.weights);
    }
}

static void any_grid_size_works(void **state)
{
    (void)state;
    static const size_t grids[][3] = {{1, 1, 2}, {2, 3, 1}, {5, 5, 5}, {33, 2, 7}};
    for (size_t i = 0; i < 4; i++) {
        const sdm_sdmnn_arch a = {.n_params = 1,
                                  .n = {grids[i][0], grids[i][1], grids[i][2]},
                                  .depth = 1 + i % 2,
                                  .channels = 2,
                                  .width = 3,
                                  .block = 1 + i,
                                  .activation = 2};
        const size_t n = sdm_sdmnn_count(&a), voxels = a.n[0] * a.n[1] * a.n[2];
        sdm_sdmnn *net;
        float *w, *values, x = 0.5f;
        assert_int_equal(sdm_sdmnn_create(&a, 0, NULL, &net, NULL), SDM_OK);
        assert_int_equal(SDM_ALLOC(&w, n, "w", NULL), SDM_OK);
        assert_int_equal(SDM_ALLOC(&values, voxels, "values", NULL), SDM_OK);
        sdm_sdmnn_init(&a, NULL, 1, 1, w);
        for (size_t v = 0; v < voxels; v++) values[v] = NAN;
        sdm_sdmnn_set(net, w);
        sdm_sdmnn_forward(net, &x, values, 1);
        for (size_t v = 0; v < voxels; v++) assert_true(isfinite(values[v]));
        sdm_sdmnn_free(net);
        sdm_free(w), sdm_free(values);
    }
}

// Without the random second dense layer, every cell of the first map is its mean over `mean`.
static void first_map_is_the_mean_of_each_cell(void **state)
{
    (void)state;
    for (int activation = 0; activation <= 2; activation += 2) { // silu, relu
        toy t;
        toy_make(&t, false, activation);
        const sdm_sdmnn_arch *a = &t.spec.arch;
        const size_t cells[] = {4, 2, 3}, second = 70 * (P + 1); // blocks of 3 in 11 x 6 x 7 voxels
        float mean[VOXELS], values[VOXELS], x[P] = {0.3f, -0.8f};
        double sum[24] = {0}, count[24] = {0};
        size_t cell_of[VOXELS];
        for (size_t v = 0; v < VOXELS; v++) {
            mean[v] = (float)(3 * sdm_rng_normal(8, 0, v));
            cell_of[v] = v % 11 / 3 + cells[0] * (v / 11 % 6 / 3 + cells[1] * (v / 66 / 3));
            sum[cell_of[v]] += (double)mean[v], count[cell_of[v]]++;
        }
        sdm_sdmnn_init(a, mean, 5, 6, t.weights);
        for (size_t i = second; i < second + 24 * 70; i++) t.weights[i] = 0;
        sdm_sdmnn *net;
        assert_int_equal(sdm_sdmnn_create(a, 0, NULL, &net, NULL), SDM_OK);
        sdm_sdmnn_set(net, t.weights);
        sdm_sdmnn_forward(net, x, values, 1);
        for (size_t v = 0; v < VOXELS; v++)
            assert_true(fabs((double)values[v] - sum[cell_of[v]] / count[cell_of[v]]) < 1e-5);
        sdm_sdmnn_free(net);
        sdm_free(t.weights);
    }
}

static void initial_weights_have_the_right_variance(void **state)
{
    (void)state;
    // With 4 channels at level 0 the second convolution has 4 * 27 inputs: variance 2 / 108 (He et
    // al. 2015). The first convolution of level 1 follows two biased convolutions of level 0.
    const size_t first = 70 * (P + 1) + 24 * 71 + (4 * 27 + 4) + (4 * 4 * 27 + 4), n = 8 * 4 * 27;
    toy t;
    toy_make(&t, false, 2);
    double s = 0;
    sdm_sdmnn_init(&t.spec.arch, NULL, 5, 6, t.weights);
    for (size_t i = first; i < first + n; i++) s += (double)t.weights[i] * (double)t.weights[i];
    assert_true(fabs(s / (double)n * 54 - 1) < 0.25);
    for (size_t i = first + n; i < first + n + 8; i++) assert_true(t.weights[i] == 0);
    // The number of multiply-adds, counted by hand for levels of 11 x 6 x 7, 6 x 3 x 4 and 3 x 2 x
    // 2 voxels.
    const double work = 70 * (P + 24) + 462 * (27 * (4 + 16 + 32 + 16) + 4) +
                        72 * (27 * (32 + 64 + 128 + 64) + 32) + 12 * (27 * (128 + 256) + 128);
    assert_true(sdm_sdmnn_work(&t.spec.arch) == work);
    sdm_free(t.weights);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(forward_is_the_definition), cmocka_unit_test(jacobian_is_the_slope),
        cmocka_unit_test(any_grid_size_works), cmocka_unit_test(first_map_is_the_mean_of_each_cell),
        cmocka_unit_test(initial_weights_have_the_right_variance)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
