/* Dense linear algebra for networks: portable C, the widest instruction set of the machine chosen
   at run time. Letters: M, N, K matrix sizes, B batch. The same bits for any number of threads. */
#ifndef SDM_KERNELS_H
#define SDM_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A matrix in memory: element (i, j) at data[i * row + j * col]. */
typedef struct sdm_view {
    const float *data;
    size_t row, col;
} sdm_view;

/* c[M][ldc] = a (M x K) * b (K x N), added to the old c when `add`. Threaded over tiles of c;
   n_threads 0: the OpenMP default. Every element is summed in the order of K in blocks of fixed
   size. */
void sdm_gemm(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c, size_t ldc,
              int n_threads);

/* Weights of a dense layer in panels of 16 outputs, the last one filled up with zeros; each panel
 * [K][16], float or half (bytes: below). */
#define SDM_PANEL 16

/* Outputs with those of filling up: y below has room for them in its last row too. */
static inline size_t sdm_panel_outputs(size_t outputs)
{
    return (outputs + SDM_PANEL - 1) / SDM_PANEL * SDM_PANEL;
}

/* Number of elements of the weights of `outputs` x k. */
static inline size_t sdm_panel_count(size_t outputs, size_t k)
{
    return sdm_panel_outputs(outputs) * k;
}

/* Packs weight(o, i) = w.data[o * w.row + i * w.col]. */
void sdm_panel_pack_f32(size_t outputs, size_t k, sdm_view w, float *panels);
void sdm_panel_pack_f16(size_t outputs, size_t k, sdm_view w, uint16_t *panels);

/* y[B][ldy] = x[B][ldx] (K floats each) times the weights; sdm_panel_outputs(outputs) floats of
   each row are written: ldy is at least that when there are several rows. One thread; the same bits
   for each row whatever B. */
void sdm_panel_f32(size_t batch, size_t outputs, size_t k, const float *w, const float *x,
                   size_t ldx, float *y, size_t ldy);
void sdm_panel_f16(size_t batch, size_t outputs, size_t k, const uint16_t *w, const float *x,
                   size_t ldx, float *y, size_t ldy);

/* The transpose: x[K] = the weights times y[sdm_panel_outputs(outputs)], of which those of filling
 * up must be finite. One thread. */
void sdm_panel_back_f32(size_t outputs, size_t k, const float *w, const float *y, float *x);
void sdm_panel_back_f16(size_t outputs, size_t k, const uint16_t *w, const float *y, float *x);

/* Weights as bytes; the first n_wide inputs have weights of two, -SDM_WIDE .. SDM_WIDE. In panels
   of 16 outputs too; in each two neighbouring inputs lie together, first the wide ones (an odd
   number takes the next input in), then the others, an odd one filled up with zero. Inputs are
   integers of 16 bits times a factor for each row, and sums are integers of 32 bits: exact, so the
   same for every instruction set. */
#define SDM_WIDE 16384
static inline size_t sdm_panel_even(size_t k) { return k + k % 2; }

/* Bytes of the weights of `outputs` x k; SIZE_MAX when they do not fit. */
size_t sdm_panel_i8_count(size_t outputs, size_t n_wide, size_t k);

/* Largest magnitude of inputs with which no sum of their products with w[outputs][k] passes the end
 * of its integer, 1 .. 32767. */
int sdm_panel_i8_limit(size_t outputs, size_t k, const int16_t *w);

/* Packs w[outputs][k], in -128 .. 127 but for the first n_wide of each row, which are in -SDM_WIDE
 * .. SDM_WIDE. */
void sdm_panel_pack_i8(size_t outputs, size_t n_wide, size_t k, const int16_t *w, int8_t *panels);

/* Each row of x[rows][ldx] = that of y[rows][ldy] times factor[n] (NULL: 1) as integers of at most
   `limit`, rounded to nearest; scale[rows]: what gives them back. Not finite numbers make it NaN
   and the row of x zero. */
void sdm_quantise(size_t rows, size_t n, const float *y, size_t ldy, const float *factor, int limit,
                  int16_t *x, size_t ldx, float *scale);

/* One row, and a second of what rounding leaves of it: x times *scale plus residual times
   *residual_scale is off by at most the largest magnitude / (2 limit^2), and rounding. */
void sdm_quantise_residual(size_t n, const float *y, const float *factor, int limit, int16_t *x,
                           float *scale, int16_t *residual, float *residual_scale);

/* What becomes of the sums of sdm_panel_i8(), times their scales: numbers, or integers for the next
 * product. */
#define SDM_PANEL_ROW 4
typedef struct sdm_panel_out {
    float *y; /* [B][ld] in rows of SDM_PANEL_ROW, `line` floats apart (SDM_PANEL_ROW: one after
                 another); NULL: integers */
    int16_t *integers; /* [B][ld] times factor, rounded to nearest; what is beyond -limit .. limit,
                          or NaN, becomes one of these */
    size_t ld, line;
    const float *mean; /* added to the first n_mean rows of y */
    size_t n_mean;
    /* of y, B: 2 .. 6: the last row is added to the first, and has no place of its own; see
     * sdm_quantise_residual() */
    bool residual;
    const float *factor; /* as many as outputs, filled up */
    int limit;
} sdm_panel_out;

/* to = scale[B] times x[B][ldx] times the weights; as sdm_panel_f32() but for the order of y. Of x,
   sdm_panel_even(k) numbers of each row are read. */
void sdm_panel_i8(size_t batch, size_t outputs, size_t n_wide, size_t k, const int8_t *w,
                  const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to);

/* One of several matrices: where its panels, inputs, their scales, outputs and their mean begin. */
typedef struct sdm_panel_block {
    size_t weights, mean;
    uint32_t outputs, n_wide, k;
    uint32_t x, scale, y;
} sdm_panel_block;

/* sdm_panel_i8() for each of n blocks in turn, with numbers as outputs; B: 1 .. 6. */
void sdm_panel_i8_blocks(size_t batch, size_t n, const sdm_panel_block *blocks, const int8_t *w,
                         const int16_t *x, size_t ldx, const float *scale, const sdm_panel_out *to);

/* The transpose, as sdm_panel_back_f32(); x has room for sdm_panel_even(k). */
void sdm_panel_back_i8(size_t outputs, size_t n_wide, size_t k, const int8_t *w, const float *y,
                       float *x);

/* Half precision (IEEE 754 binary16), round to nearest even; values beyond its range become
 * infinite. */
uint16_t sdm_half_from_float(float v);
float sdm_half_to_float(uint16_t h);

/* to[n] = y[n]. stream: past the caches, for what is large beside them and not read soon;
   sdm_copy_end(), before others read it, in the thread that wrote. One thread; the same bits either
   way. */
void sdm_copy(size_t n, const float *y, float *to, bool stream);
void sdm_copy_end(void);

/* exp(x) for n values, relative error below 2e-7, in place allowed. */
void sdm_exp(size_t n, const float *x, float *y);

/* Name of the instruction set in use: "sse2", "avx2", "avx512", "avx512vnni", "neon" or "generic".
 */
const char *sdm_kernels_name(void);

#ifdef __cplusplus
}
#endif
#endif
