/* Dense kernels (matrix products, half precision, quantisation, exponential) against plain loops in
 * double, and the same bits for any number of threads.
 * Tests: kernels_avx2.c kernels_avx512.c kernels_avx512vnni.c kernels_generic.c kernels_native.c
 * processor.c */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "sdm/internal/kernels.h"
#include "sdm/internal/processor.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"

static int level; // instruction set under test: level of sdm_processor_select()

static float *random_floats(size_t n, uint64_t stream)
{
    float *v;
    assert_int_equal(SDM_ALLOC(&v, n, "test", NULL), SDM_OK);
    for (size_t i = 0; i < n; i++) v[i] = (float)(sdm_rng_uniform(3, stream, i) - 0.5);
    return v;
}

static void product_check(size_t m, size_t n, size_t k, bool ta, bool tb, bool add)
{
    float *a = random_floats(m * k, 1), *b = random_floats(k * n, 2), *c = random_floats(m * n, 3),
          *old = random_floats(m * n, 3);
    const sdm_view va = ta ? (sdm_view){a, 1, m} : (sdm_view){a, k, 1},
                   vb = tb ? (sdm_view){b, 1, k} : (sdm_view){b, n, 1};
    sdm_gemm(m, n, k, va, vb, add, c, n, 2);
    for (size_t i = 0; i < m; i++) {
        for (size_t j = 0; j < n; j++) {
            double s = add ? old[i * n + j] : 0;
            for (size_t p = 0; p < k; p++)
                s += (double)va.data[i * va.row + p * va.col] * vb.data[p * vb.row + j * vb.col];
            assert_true(fabs(s - c[i * n + j]) <= 1e-6 * sqrt((double)k) + 1e-6);
        }
    }
    sdm_free(a);
    sdm_free(b);
    sdm_free(c);
    sdm_free(old);
}

static void products_match_plain_loops(void **state)
{
    (void)state;
    const size_t sizes[][3] = {{1, 1, 1},      {7, 5, 3},     {6, 16, 256}, {97, 129, 257},
                               {200, 33, 520}, {12, 32, 600}, {1, 300, 40}, {5, 4, 0}};
    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++)
        for (int mode = 0; mode < 8; mode++)
            product_check(sizes[i][0], sizes[i][1], sizes[i][2], mode & 1, mode & 2, mode & 4);
}

static void same_bits_for_threads(void **state)
{
    (void)state;
    const size_t m = 300, n = 280, k = 700;
    float *a = random_floats(m * k, 1), *b = random_floats(k * n, 2), *c1 = random_floats(m * n, 3),
          *c = random_floats(m * n, 3);
    sdm_gemm(m, n, k, (sdm_view){a, k, 1}, (sdm_view){b, n, 1}, false, c1, n, 1);
    for (int threads = 2; threads <= 8; threads++) {
        sdm_team *team;
        assert_int_equal(sdm_team_start(threads, &team, NULL), SDM_OK);
        memset(c, 0, m * n * sizeof *c);
        sdm_gemm(m, n, k, (sdm_view){a, k, 1}, (sdm_view){b, n, 1}, false, c, n, threads);
        assert_memory_equal(c, c1, m * n * sizeof *c);
        sdm_team_end(team);
    }
    sdm_free(a);
    sdm_free(b);
    sdm_free(c1);
    sdm_free(c);
}

static void half_conversion_is_correct(void **state)
{
    (void)state;
    for (unsigned h = 0; h < 65536; h++) { // each finite half -> float -> half: unchanged
        if ((h >> 10 & 31) == 31) continue;
        assert_int_equal(sdm_half_from_float(sdm_half_to_float((uint16_t)h)), h);
    }
    assert_int_equal(sdm_half_from_float(1.0f), 0x3c00);
    assert_int_equal(sdm_half_from_float(1.0f + 0x1p-11f), 0x3c00); // a tie rounds to even
    assert_int_equal(sdm_half_from_float(1.0f + 0x1p-11f + 0x1p-20f), 0x3c01);
    assert_int_equal(sdm_half_from_float(65504.0f), 0x7bff);
    assert_int_equal(sdm_half_from_float(-70000.0f), 0xfc00);
    assert_int_equal(sdm_half_from_float(INFINITY), 0x7c00);
    assert_int_equal(sdm_half_from_float(NAN) & 0x7c00, 0x7c00);
    assert_true(isnan(sdm_half_to_float(0x7e00)) && isinf(sdm_half_to_float(0x7c00)));
}

// Every instruction set of this machine, not only the best one.
static void half_panels_convert_exactly(void **state)
{
    (void)state;
    uint16_t *h;
    float *y;
    const float one = 1;
    assert_int_equal(SDM_ALLOC(&h, 65536, "h", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&y, 65536, "y", NULL), SDM_OK);
    for (unsigned i = 0; i < 65536; i++) h[i] = (uint16_t)i;
    for (int isa = 0; isa < SDM_PROCESSOR_LEVELS; isa++) {
        if (sdm_processor_select(isa) != isa) continue;
        // a layer with the single input 1 returns its weights
        sdm_panel_f16(1, 65536, 1, h, &one, 0, y, 0);
        for (unsigned i = 0; i < 65536; i++) {
            const float want = sdm_half_to_float((uint16_t)i);
            if (isnan(want))
                assert_true(isnan(y[i]));
            else
                assert_true(y[i] == want);
        }
    }
    sdm_processor_select(-1);
    sdm_free(h);
    sdm_free(y);
}

// Products of packed weights with 1 to 13 input rows, for numbers of outputs around the kernels'
// block sizes, with every instruction set of this machine.
static void panels_match_plain_loops(void **state)
{
    (void)state;
    enum { K = 37, ROWS = 13, N_MAX = 160 };
    float *w = random_floats(N_MAX * K, 1), *x = random_floats(ROWS * K, 2),
          *back = random_floats(N_MAX, 3);
    float *packed, *y, single[N_MAX], dx[K];
    uint16_t *half;
    assert_int_equal(SDM_ALLOC(&packed, sdm_panel_count(N_MAX, K), "t", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&half, sdm_panel_count(N_MAX, K), "t", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&y, ROWS * N_MAX, "t", NULL), SDM_OK);
    assert_int_equal(sdm_panel_count(150, K), 160 * K);
    for (int isa = 0; isa < SDM_PROCESSOR_LEVELS; isa++) {
        if (sdm_processor_select(isa) != isa) continue;
        for (size_t outputs = 1; outputs <= 150; outputs += outputs < 70 ? 1 : 40) {
            sdm_panel_pack_f32(outputs, K, (sdm_view){w, K, 1}, packed);
            sdm_panel_pack_f16(outputs, K, (sdm_view){w, K, 1}, half);
            for (int use_half = 0; use_half < 2; use_half++) {
                for (size_t rows = 1; rows <= ROWS; rows += rows < 7 ? 1 : 6) {
                    if (use_half)
                        sdm_panel_f16(rows, outputs, K, half, x, K, y, N_MAX);
                    else
                        sdm_panel_f32(rows, outputs, K, packed, x, K, y, N_MAX);
                    for (size_t r = 0; r < rows; r++) {
                        for (size_t o = 0; o < outputs; o++) {
                            double s = 0;
                            for (size_t i = 0; i < K; i++)
                                s +=
                                    (double)x[r * K + i] *
                                    (use_half ? sdm_half_to_float(sdm_half_from_float(w[o * K + i]))
                                              : w[o * K + i]);
                            assert_true(fabs(s - y[r * N_MAX + o]) < 1e-5);
                        }
                        // A row computed alone has the same bits.
                        if (use_half)
                            sdm_panel_f16(1, outputs, K, half, x + r * K, K, single, N_MAX);
                        else
                            sdm_panel_f32(1, outputs, K, packed, x + r * K, K, single, N_MAX);
                        assert_memory_equal(single, y + r * N_MAX, outputs * sizeof *single);
                    }
                }
                if (use_half)
                    sdm_panel_back_f16(outputs, K, half, back, dx);
                else
                    sdm_panel_back_f32(outputs, K, packed, back, dx);
                for (size_t i = 0; i < K; i++) {
                    double s = 0;
                    for (size_t o = 0; o < outputs; o++)
                        s += (double)back[o] *
                             (use_half ? sdm_half_to_float(sdm_half_from_float(w[o * K + i]))
                                       : w[o * K + i]);
                    assert_true(fabs(s - dx[i]) < 2e-5);
                }
            }
        }
    }
    sdm_processor_select(-1);
    sdm_free(w);
    sdm_free(x);
    sdm_free(back);
    sdm_free(packed);
    sdm_free(half);
    sdm_free(y);
}

// Integer weights and inputs: sums are exact, also close to the limits of int32, so every
// instruction set gives the same bits.
static void integer_panels_are_exact(void **state)
{
    (void)state;
    enum { N_MAX = 160, ROWS = 13, LINE = 7, APART = N_MAX / 4 * LINE };
    int16_t *w, *x;
    int8_t *packed;
    float *y, *apart, *with_rest, *back, dx[128], scale[ROWS], *mean = random_floats(N_MAX, 8),
                                                               *factor = random_floats(N_MAX, 9);
    static int16_t integers[ROWS * N_MAX];
    assert_int_equal(SDM_ALLOC(&w, N_MAX * 128, "t", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&x, ROWS * 128, "t", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&packed, sdm_panel_i8_count(N_MAX, 128, 128), "t", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&y, ROWS * N_MAX, "t", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&apart, ROWS * APART, "t", NULL), SDM_OK);
    assert_int_equal(SDM_ALLOC(&with_rest, ROWS * N_MAX, "t", NULL), SDM_OK);
    back = random_floats(N_MAX, 3);
    assert_int_equal(sdm_panel_i8_count(150, 3, 37), 160 * (4 + 38));
    assert_true(sdm_panel_i8_count(SIZE_MAX / 2, 0, 37) == SIZE_MAX &&
                sdm_panel_i8_count(1, 2, 1) == SIZE_MAX);
    for (int r = 0; r < ROWS; r++) scale[r] = 0.25f + (float)r;
    const size_t inputs[][2] = {{0, 1}, {1, 1}, {0, 12}, {1, 11}, {3, 37}, {37, 37}, {126, 127}};
    for (size_t c = 0; c < sizeof inputs / sizeof *inputs; c++) {
        const size_t wide = inputs[c][0], k = inputs[c][1];
        for (int isa = 0; isa < SDM_PROCESSOR_LEVELS; isa++) {
            if (sdm_processor_select(isa) != isa) continue;
            for (size_t outputs = 1; outputs <= 150; outputs += outputs < 70 ? 3 : 40) {
                const bool extreme = outputs % 2 == 0;
                for (size_t o = 0; o < outputs; o++)
                    for (size_t i = 0; i < k; i++) {
                        const int most = i < wide ? SDM_WIDE : 127;
                        const double u = 2 * sdm_rng_uniform(1, o, i) - 1;
                        w[o * k + i] =
                            (int16_t)(extreme ? (o % 4 ? most : -most) : (int)(u * most));
                    }
                const int limit = sdm_panel_i8_limit(outputs, k, w);
                double most = 0;
                for (size_t o = 0; o < outputs; o++) {
                    double sum = 0;
                    for (size_t i = 0; i < k; i++) sum += abs(w[o * k + i]);
                    most = fmax(most, sum);
                }
                assert_true(limit > 0 && limit * most < 2147483648.0);
                assert_true(limit == 32767 || (limit + 1) * most >= 2147483647.0);
                for (size_t r = 0; r < ROWS; r++)
                    for (size_t i = 0; i < 128; i++) {
                        const double u = 2 * sdm_rng_uniform(2, r, i) - 1;
                        x[r * 128 + i] =
                            (int16_t)(extreme ? (r % 2 ? limit : -limit) : (int)(u * limit));
                    }
                sdm_panel_pack_i8(outputs, wide, k, w, packed);
                for (size_t o = 0; o < outputs; o++) {
                    float row[128];
                    sdm_panel_row_i8(wide, k, packed, o, row);
                    for (size_t i = 0; i < k; i++) assert_true(row[i] == (float)w[o * k + i]);
                }
                for (size_t rows = 1; rows <= ROWS; rows += rows < 7 ? 1 : 6) {
                    const size_t n_mean = rows / 2;
                    const sdm_panel_out plain = {.y = y, .ld = N_MAX, .line = SDM_PANEL_ROW},
                                        added = {.y = apart,
                                                 .ld = APART,
                                                 .line = LINE,
                                                 .mean = mean,
                                                 .n_mean = n_mean},
                                        again = {.integers = integers,
                                                 .ld = N_MAX,
                                                 .factor = factor,
                                                 .limit = 1234},
                                        whole = {.y = with_rest,
                                                 .ld = N_MAX,
                                                 .line = SDM_PANEL_ROW,
                                                 .residual = true};
                    for (size_t o = 0; o < outputs; o++)
                        factor[o] = (o % 3 ? 3e-4f : -1e-6f) / (float)k;
                    sdm_panel_i8(rows, outputs, wide, k, packed, x, 128, scale, &plain);
                    sdm_panel_i8(rows, outputs, wide, k, packed, x, 128, scale, &added);
                    sdm_panel_i8(rows, outputs, wide, k, packed, x, 128, scale, &again);
                    // With `residual` the last row is added to the first; the other rows and the
                    // memory behind them stay unchanged.
                    if (rows > 1 && rows <= 6) {
                        float *const behind = with_rest + (rows - 1) * N_MAX, *const last =
                                                                                  y + (rows - 1) *
                                                                                          N_MAX;
                        for (int o = 0; o < N_MAX; o++) behind[o] = 77;
                        sdm_panel_i8(rows, outputs, wide, k, packed, x, 128, scale, &whole);
                        for (size_t o = 0; o < outputs; o++)
                            assert_true(fabsf(with_rest[o] - (y[o] + last[o])) <=
                                        1.2e-7f * (fabsf(y[o]) + fabsf(last[o])));
                        for (size_t r = 1; r + 1 < rows; r++)
                            assert_memory_equal(with_rest + r * N_MAX, y + r * N_MAX,
                                                outputs * sizeof *y);
                        for (int o = 0; o < N_MAX; o++) assert_true(behind[o] == 77);
                    }
                    for (size_t r = 0; r < rows; r++)
                        for (size_t o = 0; o < outputs; o++) {
                            int64_t s = 0;
                            for (size_t i = 0; i < k; i++)
                                s += (int64_t)w[o * k + i] * x[r * 128 + i];
                            const float v = scale[r] * (float)s,
                                        sum = apart[r * APART + o / 4 * LINE + o % 4];
                            const float units = fminf(fmaxf(v * factor[o], -1234), 1234);
                            assert_true(y[r * N_MAX + o] == v);
                            // Some instruction sets fuse multiply and add, so the sum is rounded
                            // only once.
                            if (r < n_mean)
                                assert_true(fabsf(sum - (v + mean[o])) <=
                                            1.2e-7f * (fabsf(v) + fabsf(mean[o])));
                            else
                                assert_true(sum == v);
                            assert_int_equal(integers[r * N_MAX + o], lrintf(units));
                        }
                }
                sdm_panel_back_i8(outputs, wide, k, packed, back, dx);
                for (size_t i = 0; i < k; i++) {
                    double s = 0, size = 0;
                    for (size_t o = 0; o < outputs; o++) {
                        s += (double)back[o] * w[o * k + i];
                        size += fabs((double)back[o] * w[o * k + i]);
                    }
                    assert_true(fabs(s - dx[i]) <= 1e-6 * size);
                }
            }
        }
    }
    sdm_processor_select(-1);
    sdm_free(w);
    sdm_free(x);
    sdm_free(packed);
    sdm_free(y);
    sdm_free(apart);
    sdm_free(with_rest);
    sdm_free(back);
    sdm_free(mean);
    sdm_free(factor);
}

// sdm_copy() to every alignment of the target writes n floats and nothing beside them.
static void copies_to_any_alignment(void **state)
{
    (void)state;
    enum { N_MAX = 90, SIDE = 17 };
    float *y = random_floats(N_MAX, 6), *memory = random_floats(N_MAX + 2 * SIDE, 8);
    y[3] = -0.0f;
    for (size_t n = 0; n <= N_MAX; n++)
        for (size_t offset = 0; offset < 16; offset++)
            for (int stream = 0; stream < 2; stream++) {
                float *to = memory + 1 + offset;
                to[-1] = to[n] = 77;
                sdm_copy(n, y, to, stream);
                sdm_copy_end();
                assert_memory_equal(to, y, n * sizeof *y);
                assert_true(to[-1] == 77 && to[n] == 77);
            }
    sdm_free(y);
    sdm_free(memory);
}

// Quantisation of several rows with a scale each: the error is at most half a unit, and nothing is
// written beside the rows.
static void quantisation_stays_within_half_a_unit(void **state)
{
    (void)state;
    enum { N_MAX = 70, ROWS = 3, LDY = 75, LDX = 73 };
    float *y = random_floats(ROWS * LDY, 4), *factor = random_floats(N_MAX, 5), changed[N_MAX],
          ones[N_MAX], scale[ROWS];
    int16_t x[ROWS * LDX + 1];
    for (int i = 0; i < N_MAX; i++) ones[i] = 1;
    for (int isa = 0; isa < SDM_PROCESSOR_LEVELS; isa++) {
        if (sdm_processor_select(isa) != isa) continue;
        for (size_t n = 0; n <= N_MAX; n++)
            for (int limit = 5; limit < 32768; limit += 10920)
                for (int plain = 0; plain < 2; plain++) {
                    for (size_t r = 0; r < ROWS; r++) x[r * LDX + n] = 77;
                    sdm_quantise(ROWS, n, y, LDY, plain ? NULL : factor, limit, x, LDX, scale);
                    for (size_t r = 0; r < ROWS; r++) {
                        double most = 0;
                        for (size_t i = 0; i < n; i++) {
                            const int16_t at = x[r * LDX + i];
                            const double want = (double)y[r * LDY + i] * (plain ? 1 : factor[i]);
                            most = fmax(most, abs(at));
                            assert_true(fabs((double)at * scale[r] - want) <= 0.5001 * scale[r]);
                        }
                        assert_true(n == 0 ? scale[r] == 0 : most == limit);
                        assert_int_equal(x[r * LDX + n], 77);
                    }
                }
        for (size_t n = 1; n <= N_MAX;
             // Value plus quantised residual is as accurate as a float; the first row equals plain
             // quantisation.
             n++)
            for (int limit = 1; limit < 32768; limit += 8191)
                for (int plain = 0; plain < 2; plain++) {
                    const float *const f = plain ? NULL : factor;
                    int16_t alone[N_MAX], rest[N_MAX + 1];
                    float s, rest_scale;
                    x[n] = rest[n] = 77;
                    sdm_quantise_residual(n, y, f, limit, x, &scale[0], rest, &rest_scale);
                    sdm_quantise(1, n, y, 0, f, limit, alone, 0, &s);
                    assert_true(s == scale[0] && x[n] == 77 && rest[n] == 77);
                    assert_memory_equal(x, alone, n * sizeof *x);
                    for (size_t i = 0; i < n; i++) {
                        const double want = (double)y[i] * (plain ? 1 : factor[i]);
                        const double unit = fmax(0.5001 * rest_scale, 2.5e-7 * limit * scale[0]);
                        assert_true(abs(rest[i]) <= limit);
                        assert_true(fabs((double)x[i] * scale[0] + (double)rest[i] * rest_scale -
                                         want) <= unit);
                    }
                }
        for (int i = 0; i < N_MAX; i++) changed[i] = i % 2 ? 1e-40f : 0;
        sdm_quantise(1, N_MAX, changed, 0, ones, 32767, x, 0, scale);
        assert_true(scale[0] == 0 && x[3] == 0);
        sdm_quantise_residual(N_MAX, changed, ones, 32767, x, &scale[0], x + LDX, &scale[1]);
        assert_true(scale[0] == 0 && scale[1] == 0 && x[3] == 0 && x[LDX + 3] == 0);
        const float wrong[] = {NAN, -NAN, INFINITY, -INFINITY};
        for (int k = 0; k < 4; k++)
            for (int at = 0; at < N_MAX; at += 23) {
                memcpy(changed, y, sizeof changed);
                changed[at] = wrong[k];
                sdm_quantise(1, N_MAX, changed, 0, ones, 32767, x, 0, scale);
                assert_true(isnan(scale[0]));
                assert_int_equal(x[1], 0);
                sdm_quantise_residual(N_MAX, changed, ones, 32767, x, &scale[0], x + LDX,
                                      &scale[1]);
                assert_true(isnan(scale[0]) && isnan(scale[1]) && x[1] == 0 && x[LDX + 1] == 0);
            }
    }
    sdm_processor_select(-1);
    sdm_free(y);
    sdm_free(factor);
}

// Several matrices multiplied in one call give the same bits as one call for each.
static void blocks_in_one_call_match_single_calls(void **state)
{
    (void)state;
    enum { N = 4, ROWS = 6, LDX = 64, LDY = 280, LINE = 17, N_MAX = 4096 };
    const size_t outputs[N] = {16, 64, 37, 32}, wide[N] = {1, 2, 0, 5}, k[N] = {9, 6, 11, 5};
    int16_t w[64 * 11], x[ROWS * LDX];
    int8_t *packed = NULL;
    float scale[N * ROWS], *y = random_floats(ROWS * LDY, 1), *each = random_floats(ROWS * LDY, 1);
    float *mean = random_floats(N * 64, 2);
    assert_int_equal(SDM_ALLOC(&packed, N_MAX, "weights", NULL), SDM_OK);
    sdm_panel_block b[N];
    size_t at = 0;
    uint32_t input = 0, row = 0;
    for (uint32_t i = 0; i < N; i++) {
        for (size_t v = 0; v < outputs[i] * k[i]; v++)
            w[v] = (int16_t)(255 * sdm_rng_uniform(3, i, v) - 127);
        b[i] = (sdm_panel_block){
            at,       64 * i, (uint32_t)outputs[i], (uint32_t)wide[i], (uint32_t)k[i], input,
            i * ROWS, row};
        assert_true(at + sdm_panel_i8_count(outputs[i], wide[i], k[i]) <= N_MAX);
        sdm_panel_pack_i8(outputs[i], wide[i], k[i], w, packed + at);
        at += sdm_panel_i8_count(outputs[i], wide[i], k[i]);
        input += (uint32_t)sdm_panel_even(k[i]);
        row += 4;
    }
    for (size_t i = 0; i < ROWS * LDX; i++)
        x[i] = (int16_t)(60000 * sdm_rng_uniform(4, 0, i) - 30000);
    for (size_t i = 0; i < N * ROWS; i++) scale[i] = 0.5f + (float)i;
    for (size_t rows = 1; rows <= ROWS; rows++) {
        sdm_panel_out to = {.y = y, .ld = LDY, .line = LINE, .mean = mean, .n_mean = rows - 1};
        sdm_panel_i8_blocks(rows, N, b, packed, x, LDX, scale, &to);
        for (uint32_t i = 0; i < N; i++) {
            to.y = each + b[i].y, to.mean = mean + b[i].mean;
            sdm_panel_i8(rows, outputs[i], wide[i], k[i], packed + b[i].weights, x + b[i].x, LDX,
                         scale + b[i].scale, &to);
        }
        assert_memory_equal(y, each, ROWS * LDY * sizeof *y);
    }
    sdm_free(packed);
    sdm_free(y);
    sdm_free(each);
    sdm_free(mean);
}

static void exponential_is_accurate(void **state)
{
    (void)state;
    float x[1001], y[1001];
    for (int i = 0; i < 1001; i++) x[i] = -86.0f + 0.1713f * (float)i;
    sdm_exp(1001, x, y);
    for (int i = 0; i < 1001; i++) assert_true(fabs((double)y[i] / exp((double)x[i]) - 1) < 2e-7);
    const float far[3] = {-1e9f, 1e9f, 0};
    sdm_exp(3, far, y);
    assert_true(y[0] >= 0 && y[0] < 1e-37f && isfinite(y[1]) && y[1] > 1e38f && y[2] == 1);
}

static void instruction_sets_have_their_names(void **state)
{
    (void)state;
#if defined(__x86_64__)
    static const char *const name[] = {"sse2", "avx2", "avx512", "avx512vnni"};
#elif defined(__aarch64__)
    static const char *const name[] = {"neon"};
#else
    static const char *const name[] = {"generic"};
#endif
    const int used = sdm_processor_select(level);
    assert_int_equal(used, level);
    assert_string_equal(sdm_kernels_name(), name[level]);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(products_match_plain_loops),
                                       cmocka_unit_test(same_bits_for_threads),
                                       cmocka_unit_test(half_conversion_is_correct),
                                       cmocka_unit_test(half_panels_convert_exactly),
                                       cmocka_unit_test(panels_match_plain_loops),
                                       cmocka_unit_test(integer_panels_are_exact),
                                       cmocka_unit_test(copies_to_any_alignment),
                                       cmocka_unit_test(blocks_in_one_call_match_single_calls),
                                       cmocka_unit_test(quantisation_stays_within_half_a_unit),
                                       cmocka_unit_test(exponential_is_accurate),
                                       cmocka_unit_test(instruction_sets_have_their_names)};
    // Every instruction set of this machine, not only the best one.
    int failed = 0;
    for (level = sdm_processor_select(-1); level >= 0; level--) {
        sdm_processor_select(level);
        failed += cmocka_run_group_tests(tests, NULL, NULL);
    }
    return failed;
}
