/* Operators on feature maps (fmap.h) other than the convolution. Letters: C channels, B batch, I
   inputs, O outputs. One thread computes each element, in a fixed order: the result does not depend
   on n_threads, which is >= 1 (sdm_dense functions: 0 is the OpenMP default). */
#ifndef SDM_OPERATORS_H
#define SDM_OPERATORS_H

#include <stdint.h>

#include "fmap.h"

/* Max pooling by 2: from x[C] of layout g to y[C] of layout h, with h.n = ceil(g.n / 2). A window
   at the border has only the voxels inside. Of equal maxima the first in memory counts. */
void sdm_pool_forward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      float *y, int n_threads);
/* Tangent: dy = dx at the voxel with the maximum of x in each window. */
void sdm_pool_tangent(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      const float *dx, float *dy, int n_threads);
/* Transpose: dx += dy at the voxel with the maximum of x in each window. */
void sdm_pool_backward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                       const float *dy, float *dx, int n_threads);

/* Nearest-neighbour up-sampling: voxel i of y[C], layout g, is voxel floor(i / factor) of x[C],
   layout h, with h.n = ceil(g.n / factor). It is linear, hence its own tangent. */
void sdm_upsample_forward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                          const float *x, float *y, int n_threads);
/* Transpose: dx = sum of dy over the copies of each voxel. */
void sdm_upsample_backward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                           const float *dy, float *dx, int n_threads);

/* Drop-out (Srivastava et al. 2014), in place: each element of y[C], and the same element of
   slope[C], becomes 0 with probability `rate`, else it is divided by 1 - rate. Random bits: blocks
   (seed, stream, index .. index + sdm_dropout_draws() - 1) of sdm_rng_block(). */
size_t sdm_dropout_draws(const sdm_fmap *g, size_t channels);
void sdm_dropout(const sdm_fmap *g, size_t channels, double rate, uint64_t seed, uint64_t stream,
                 uint64_t index, float *y, float *slope, int n_threads);

/* Dense layer: y[B][O] = x[B][I] w[O][I]^T + bias[O]; bias NULL: 0. */
void sdm_dense_forward(size_t batch, size_t in, size_t out, const float *w, const float *bias,
                       const float *x, float *y, int n_threads);
/* Its gradients: dw[O][I] += dy^T x, db[O] += sum over the batch of dy, dx[B][I] = dy w unless
 * NULL. */
void sdm_dense_backward(size_t batch, size_t in, size_t out, const float *w, const float *x,
                        const float *dy, float *dw, float *db, float *dx, int n_threads);

#endif
