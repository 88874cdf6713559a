/* Operators on feature maps (fmap.h) beside the convolution. Letters: C channels, B batch, I
   inputs, O outputs. Each element is computed by one thread in one order: the same bits for any
   number of threads. Merging is no operator: maps that are merged lie one after the other. */
#ifndef SDM_OPERATORS_H
#define SDM_OPERATORS_H

#include <stdint.h>

#include "fmap.h"

/* Max pooling by 2: y[C] of layout h, whose sizes are ceil(n / 2) of g's; a window that the border
   cuts takes what it has of x[C] of layout g. Of equal values the first in memory counts. */
void sdm_pool_forward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      float *y, int n_threads);
/* Tangent: dy = dx where x was the largest. */
void sdm_pool_tangent(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      const float *dx, float *dy, int n_threads);
/* dx += dy where x was the largest. */
void sdm_pool_backward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                       const float *dy, float *dx, int n_threads);

/* Up-sampling to the nearest: voxel i of y[C], layout g, is voxel floor(i / factor) of x[C], layout
   h, whose sizes are ceil(n / factor). Linear: also its own tangent. */
void sdm_upsample_forward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                          const float *x, float *y, int n_threads);
/* dx = sums of dy. */
void sdm_upsample_backward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                           const float *dy, float *dx, int n_threads);

/* Drop-out (Srivastava et al. 2014): each of y and slope is set to 0 with probability `rate`, else
   divided by 1 - rate. Random bits from (seed, stream, index .. index + sdm_dropout_draws). */
size_t sdm_dropout_draws(const sdm_fmap *g, size_t channels);
void sdm_dropout(const sdm_fmap *g, size_t channels, double rate, uint64_t seed, uint64_t stream,
                 uint64_t index, float *y, float *slope, int n_threads);

/* Dense layer y[B][O] = x[B][I] w[O][I]^T + bias[O] (NULL: none, the tangent). */
void sdm_dense_forward(size_t batch, size_t in, size_t out, const float *w, const float *bias,
                       const float *x, float *y, int n_threads);
/* dw[O][I] += dy^T x, db[O] += sum of dy, dx[B][I] = dy w when not NULL. */
void sdm_dense_backward(size_t batch, size_t in, size_t out, const float *w, const float *x,
                        const float *dy, float *dw, float *db, float *dx, int n_threads);

#endif
