/* Dense linear algebra for networks. The kernels are portable C, compiled once for each instruction
   set; the widest one of the machine is chosen at run time.

   Letters: M, N, K sizes of matrices, B rows of a batch. No function allocates memory or fails. The
   results do not depend on the number of threads; in floats they differ by rounding between
   instruction sets. All functions may be called from any thread, and all except sdm_gemm() run in
   the calling thread alone. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A matrix in memory: element (i, j) is data[i * row + j * col]. */
typedef struct sdm_view {
    const float *data;
    size_t row, col;
} sdm_view;

/* Matrix product: c[M][ldc] = a * b, or c += a * b with `add`; a is M x K, b is K x N. A product
   with K = 0 is zero. Up to n_threads threads of the caller's team (sdm/internal/team.h) share the
   blocks of c. The K products of each element are summed in ascending order. */
void sdm_gemm(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c, size_t ldc,
              int n_threads);

/* Weights of a dense layer with K inputs are stored in panels of SDM_PANEL outputs. A panel of
   floats or halves is [K][SDM_PANEL]; the last panel is padded with zeros. */
#define SDM_PANEL 16

/* Number of outputs rounded up to whole panels: the "padded outputs" of the functions below. */
static inline size_t sdm_panel_outputs(size_t outputs)
{
    return (outputs + SDM_PANEL - 1) / SDM_PANEL * SDM_PANEL;
}

/* Number of elements in the panels of outputs x k weights. */
static inline size_t sdm_panel_count(size_t outputs, size_t k)
{
    return sdm_panel_outputs(outputs) * k;
}

/* Index of the weight between `input` and `output` in panels of floats or halves. */
static inline size_t sdm_panel_index(size_t k, size_t output, size_t input)
{
    return (output / SDM_PANEL * k + input) * SDM_PANEL + output % SDM_PANEL;
}

/* panels[sdm_panel_count(outputs, k)] = the outputs x k matrix w. */
void sdm_panel_pack_f32(size_t outputs, size_t k, sdm_view w, float *panels);
void sdm_panel_pack_f16(size_t outputs, size_t k, sdm_view w, uint16_t *panels);

/* y[B][ldy] = x[B][ldx] * w^T. Each row of x has K inputs. sdm_panel_outputs(outputs) floats are
   written to each row of y, hence ldy >= sdm_panel_outputs(outputs) for B > 1. The result for a row
   does not depend on B. */
void sdm_panel_f32(size_t batch, size_t outputs, size_t k, const float *w, const float *x,
                   size_t ldx, float *y, size_t ldy);
void sdm_panel_f16(size_t batch, size_t outputs, size_t k, const uint16_t *w, const float *x,
                   size_t ldx, float *y, size_t ldy);

/* The transpose: x[K] = w^T * y for y[sdm_panel_outputs(outputs)], whose padding must be finite. */
void sdm_panel_back_f32(size_t outputs, size_t k, const float *w, const float *y, float *x);
void sdm_panel_back_f16(size_t outputs, size_t k, const uint16_t *w, const float *y, float *x);

/* Products with integer weights. The first n_wide inputs are wide: their weights have two bytes and
   lie in -SDM_WIDE .. SDM_WIDE. The other inputs are narrow: their weights have one byte,
   -128 .. 127. Inputs are integers of 16 bits with one scale for each row: value = integer * scale.
   Sums of products are integers of 32 bits, hence exact and the same for every instruction set.

   A panel of SDM_PANEL outputs holds pairs of neighbouring inputs, [pair][SDM_PANEL][2], first the
   wide pairs, then the narrow ones. With an odd n_wide the first narrow input joins the last wide
   pair; with an odd K the last pair is padded with zero weights. */
#define SDM_WIDE 16384

/* k rounded up to an even number. */
static inline size_t sdm_panel_even(size_t k) { return k + k % 2; }

/* Bytes of the panels of outputs x k weights; SIZE_MAX on overflow or for n_wide > k. */
size_t sdm_panel_i8_count(size_t outputs, size_t n_wide, size_t k);

/* Largest L in 1 .. 32767 such that no sum over k of w[o][k] * x[k] with abs(x[k]) <= L overflows
   32 bits; w[outputs][k]. */
int sdm_panel_i8_limit(size_t outputs, size_t k, const int16_t *w);

/* panels[sdm_panel_i8_count(outputs, n_wide, k)] = the weights w[outputs][k], which must lie in the
   ranges of wide and narrow weights. */
void sdm_panel_pack_i8(size_t outputs, size_t n_wide, size_t k, const int16_t *w, int8_t *panels);

/* w[k] = row `row` of the matrix in the panels. */
void sdm_panel_row_i8(size_t n_wide, size_t k, const int8_t *panels, size_t row, float *w);

/* Quantises rows: with v = y[r][i] * factor[i] (factor[n]; NULL: 1) and m = the largest abs(v) of
   row r, x[r][i] = v * limit / m rounded to nearest, and scale[r] = m / limit, so that
   v = x[r][i] * scale[r] up to rounding. y[rows][ldy], x[rows][ldx], 1 <= limit <= 32767. A row of
   zeros (or of values too small for limit / m to be a float) gives zeros and scale 0. A row with
   NaN or infinity gives zeros and scale NaN. */
void sdm_quantise(size_t rows, size_t n, const float *y, size_t ldy, const float *factor, int limit,
                  int16_t *x, size_t ldx, float *scale);

/* Quantises one row y[n] and its rounding error: x[n] and *scale as sdm_quantise(), and
   residual[n] with *residual_scale = *scale / limit, such that
   abs(x * *scale + residual * *residual_scale - v) <= m / (2 limit^2) + rounding in float. */
void sdm_quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                           float *scale, int16_t *residual, float *residual_scale);

/* Number of outputs that sdm_panel_i8() stores contiguously. */
#define SDM_PANEL_ROW 4

/* Destination of sdm_panel_i8(): the floats y, or, if y is NULL, the array `integers`, which are
   inputs of a next product. Each row has room for sdm_panel_outputs(outputs) outputs. */
typedef struct sdm_panel_out {
    /* Output o of row r is y[r * ld + o / SDM_PANEL_ROW * line + o % SDM_PANEL_ROW]. With
       line = SDM_PANEL_ROW all outputs of a row are contiguous. */
    float *y;
    /* integers[B][ld] = output * factor, rounded to nearest and clipped to -limit .. limit; NaN
       becomes one of the two ends. */
    int16_t *integers;
    size_t ld, line;
    /* mean[padded outputs] is added to the first n_mean rows of y; not read for n_mean = 0. */
    const float *mean;
    size_t n_mean;
    /* For y and B = 2 .. 6: the result of the last row is added to the first row instead of being
       stored. The last row is the residual of sdm_quantise_residual(). */
    bool residual;
    const float *factor; /* for `integers`: [padded outputs] */
    int limit;           /* for `integers`: 1 .. 32767 */
} sdm_panel_out;

/* *to = scale[r] * (w * x[r]) for the rows r of x[B][ldx]; scale[B]. The first sdm_panel_even(k)
   integers of each row of x are read; for an odd K the weight of the last one is zero. */
void sdm_panel_i8(size_t batch, size_t outputs, size_t n_wide, size_t k, const int8_t *w,
                  const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to);

/* One of several matrices of sdm_panel_i8_blocks(). */
typedef struct sdm_panel_block {
    size_t weights, mean;        /* offsets of its panels in w and of its mean in to->mean */
    uint32_t outputs, n_wide, k; /* as in sdm_panel_i8() */
    uint32_t x, scale, y;        /* offsets into rows of x, into scale and into rows of to->y */
} sdm_panel_block;

/* Calls sdm_panel_i8() for each of blocks[n] in turn. 1 <= B <= 6; to->y must not be NULL. */
void sdm_panel_i8_blocks(size_t batch, size_t n, const sdm_panel_block *blocks, const int8_t *w,
                         const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to);

/* The transpose: x[sdm_panel_even(k)] = w^T * y, y[sdm_panel_outputs(outputs)] floats, whose
   padding must be finite. */
void sdm_panel_back_i8(size_t outputs, size_t n_wide, size_t k, const int8_t *w, const float *y,
                       float *x);

/* Half precision (IEEE 754 binary16), rounded to nearest even; values beyond its range become
   infinite, NaN stays NaN. */
uint16_t sdm_half_from_float(float v);
float sdm_half_to_float(uint16_t h);

/* Element `i` of an array of weights, which are halves or floats. */
static inline float sdm_weight_at(const void *weights, bool half, size_t i)
{
    return half ? sdm_half_to_float(((const uint16_t *)weights)[i]) : ((const float *)weights)[i];
}

/* to[n] = y[n], without overlap. stream: the stores bypass the caches, for data that are larger
   than the caches and not read soon. After streaming, the same thread calls sdm_copy_end() before
   another thread reads the data. */
void sdm_copy(size_t n, const float *y, float *to, bool stream);
void sdm_copy_end(void);

/* y[n] = exp(x[n]) with x clamped to -87 .. 88, relative error below 2e-7; y may be x. */
void sdm_exp(size_t n, const float *x, float *y);

/* Name of the instruction set in use: "sse2", "avx2", "avx512", "avx512vnni", "neon" or
   "generic". */
const char *sdm_kernels_name(void);

#ifdef __cplusplus
}
#endif
