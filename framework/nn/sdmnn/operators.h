/* Operators on feature maps (fmap.h) other than the convolution, and dense layers. Letters: C
   channels, B batch, I inputs, O outputs. Each element is computed by one thread in a fixed order,
   so that the result does not depend on n_threads. n_threads >= 1; the sdm_dense functions also
   accept 0, the OpenMP default. */
#pragma once

#include <stdint.h>

#include "fmap.h"

/* Max pooling by 2: from x[C] of layout g to y[C] of layout h, with h.n = ceil(g.n / 2). A window
   at the border has only the voxels inside the grid. If maxima are equal, the first in memory
   counts. */
void sdm_pool_forward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      float *y, int n_threads);
/* Directional derivative: dy = dx at the voxel with the maximum of x in each window. */
void sdm_pool_tangent(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      const float *dx, float *dy, int n_threads);
/* Transpose: dx += dy at the voxel with the maximum of x in each window. */
void sdm_pool_backward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                       const float *dy, float *dx, int n_threads);

/* Nearest-neighbour up-sampling from x[C] of layout h to y[C] of layout g, with
   h.n = ceil(g.n / factor): voxel i of y is voxel floor(i / factor) of x along each axis. The
   operator is linear, so that it also computes directional derivatives. */
void sdm_upsample_forward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                          const float *x, float *y, int n_threads);
/* Transpose: dx = sum of dy over the copies of each voxel. */
void sdm_upsample_backward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                           const float *dy, float *dx, int n_threads);

/* Drop-out (Srivastava et al. 2014), in place: each element of y[C], together with the same element
   of slope[C], becomes 0 with probability `rate`, else it is divided by 1 - rate. The random bits
   are the blocks (seed, stream, index .. index + sdm_dropout_draws() - 1) of sdm_rng_block(). */
size_t sdm_dropout_draws(const sdm_fmap *g, size_t channels);
void sdm_dropout(const sdm_fmap *g, size_t channels, double rate, uint64_t seed, uint64_t stream,
                 uint64_t index, float *y, float *slope, int n_threads);

/* Dense layer: y[B][O] = x[B][I] w[O][I]^T + bias[O]; bias NULL: 0. */
void sdm_dense_forward(size_t batch, size_t in, size_t out, const float *w, const float *bias,
                       const float *x, float *y, int n_threads);
/* Gradients of the dense layer: dw[O][I] += dy^T x, db[O] += sum over the batch of dy, and, unless
 * dx is NULL, dx[B][I] = dy w. */
void sdm_dense_backward(size_t batch, size_t in, size_t out, const float *w, const float *x,
                        const float *dy, float *dw, float *db, float *dx, int n_threads);
