/* Dense linear algebra for networks: portable C, the widest instruction set of the machine chosen at run time.
   Letters: M, N, K matrix sizes, B batch. The same bits for any number of threads. */
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

/* c[M][ldc] = a (M x K) * b (K x N), added to the old c when `add`. Threaded over tiles of c; n_threads 0: the OpenMP default.
   Every element is summed in the order of K in blocks of fixed size. */
SDM_API void sdm_gemm(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c, size_t ldc,
                      int n_threads);

/* Weights of a dense layer in panels of 16 outputs, the last one filled up with zeros; each panel [K][16], float or half (bytes: below). */
#define SDM_PANEL 16

/* Outputs with those of filling up: y below has room for them in its last row too. */
static inline size_t sdm_panel_outputs(size_t outputs) { return (outputs + SDM_PANEL - 1) / SDM_PANEL * SDM_PANEL; }

/* Number of elements of the weights of `outputs` x k. */
static inline size_t sdm_panel_count(size_t outputs, size_t k) { return sdm_panel_outputs(outputs) * k; }

/* Packs weight(o, i) = w.data[o * w.row + i * w.col]. */
SDM_API void sdm_panel_pack_f32(size_t outputs, size_t k, sdm_view w, float *panels);
SDM_API void sdm_panel_pack_f16(size_t outputs, size_t k, sdm_view w, uint16_t *panels);

/* y[B][ldy] = x[B][ldx] (K floats each) times the weights; sdm_panel_outputs(outputs) floats of each row are written:
   ldy is at least that when there are several rows. One thread; the same bits for each row whatever B. */
SDM_API void sdm_panel_f32(size_t batch, size_t outputs, size_t k, const float *w, const float *x, size_t ldx, float *y,
                           size_t ldy);
SDM_API void sdm_panel_f16(size_t batch, size_t outputs, size_t k, const uint16_t *w, const float *x, size_t ldx,
                           float *y, size_t ldy);

/* The transpose: x[K] = the weights times y[sdm_panel_outputs(outputs)], of which those of filling up must be finite. One thread. */
SDM_API void sdm_panel_back_f32(size_t outputs, size_t k, const float *w, const float *y, float *x);
SDM_API void sdm_panel_back_f16(size_t outputs, size_t k, const uint16_t *w, const float *y, float *x);

/* Weights as bytes: the weight of output o and input i is fine[o][i] + 256 coarse[o][i], fine from -128 to 127, coarse from -64 to 64;
   only the first n_coarse inputs have a coarse part. In panels of 16 outputs too; in each two neighbouring inputs lie together, first all coarse
   parts, then all fine ones, an odd one filled up with zero. Inputs are integers of 16 bits times a factor for each row, and sums are
   integers of 32 bits: exact, so the same for every instruction set. */
#define SDM_COARSE 16384
static inline size_t sdm_panel_even(size_t k) { return k + k % 2; }

/* Bytes of the weights of `outputs` x k; SIZE_MAX when they do not fit. */
SDM_API size_t sdm_panel_i8_count(size_t outputs, size_t n_coarse, size_t k);

/* Largest magnitude of inputs with which no sum of their products with w[outputs][k] passes the end of its integer, 1 .. 32767. */
SDM_API int sdm_panel_i8_limit(size_t outputs, size_t k, const int16_t *w);

/* Packs w[outputs][k], in -128 .. 127 but for the first n_coarse of each row, which are in -SDM_COARSE .. SDM_COARSE. */
SDM_API void sdm_panel_pack_i8(size_t outputs, size_t n_coarse, size_t k, const int16_t *w, int8_t *panels);

/* x[n] = y[n] factor[n] (factor NULL: 1) as integers of at most `limit`, rounded to nearest; returns the factor that gives them back.
   Not finite numbers make it NaN and x zero. */
SDM_API float sdm_quantise(size_t n, const float *y, const float *factor, int limit, int16_t *x);

/* y[B][ldy] = scale[B] times x[B][ldx] times the weights; as sdm_panel_f32(). Of x, sdm_panel_even(k) numbers of each row are read. */
SDM_API void sdm_panel_i8(size_t batch, size_t outputs, size_t n_coarse, size_t k, const int8_t *w, const int16_t *x,
                          size_t ldx, const float *scale, float *y, size_t ldy);

/* The transpose, as sdm_panel_back_f32(); x has room for sdm_panel_even(k). */
SDM_API void sdm_panel_back_i8(size_t outputs, size_t n_coarse, size_t k, const int8_t *w, const float *y, float *x);

/* Half precision (IEEE 754 binary16), round to nearest even; values beyond its range become infinite. */
SDM_API uint16_t sdm_half_from_float(float v);
SDM_API float sdm_half_to_float(uint16_t h);

/* exp(x) for n values, relative error below 2e-7, in place allowed. */
SDM_API void sdm_exp(size_t n, const float *x, float *y);

/* Name of the instruction set in use: "sse2", "avx2", "avx512", "neon" or "generic". */
SDM_API const char *sdm_kernels_name(void);

#ifdef __cplusplus
}
#endif
#endif
