/* Dense linear algebra for networks: portable C, the widest instruction set of the machine chosen at run time.
   Letters: M, N, K matrix sizes, B batch, T = SDM_TILE outputs of a tile. The same bits for any number of threads. */
#ifndef SDM_KERNELS_H
#define SDM_KERNELS_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/export.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_TILE 64

/* A matrix in memory: element (i, j) at data[i * row + j * col]. */
typedef struct sdm_view {
    const float *data;
    size_t row, col;
} sdm_view;

/* c[M][ldc] = a (M x K) * b (K x N), added to the old c when `add`. Threaded over tiles of c; n_threads 0: the OpenMP default.
   Every element is summed in the order of K in blocks of fixed size. */
SDM_API void sdm_gemm(size_t m, size_t n, size_t k, sdm_view a, sdm_view b, bool add, float *c, size_t ldc,
                      int n_threads);

/* Weights of a dense layer in tiles: w[tiles][K][T], float or half. Number of elements for `outputs` outputs. */
SDM_API size_t sdm_tiled_count(size_t outputs, size_t k);

/* Packs weight(o, i) = w.data[o * w.row + i * w.col] of `outputs` x k into tiles; the rest of the last tile is zero. */
SDM_API void sdm_tiled_pack_f32(size_t outputs, size_t k, sdm_view w, float *tiled);
SDM_API void sdm_tiled_pack_f16(size_t outputs, size_t k, sdm_view w, uint16_t *tiled);

/* One tile: y[B][ldy] (T floats each) = x[B][ldx] (K floats each) times the tile w[K][T]; one thread. scratch: K * T floats, used by
   the half version from B = 2 on. */
SDM_API void sdm_tile_f32(size_t batch, size_t k, const float *w, const float *x, size_t ldx, float *y, size_t ldy);
SDM_API void sdm_tile_f16(size_t batch, size_t k, const uint16_t *w, const float *x, size_t ldx, float *y, size_t ldy,
                          float *scratch);

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
