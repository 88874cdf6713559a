/* Convolution of feature maps (fmap.h), 3 x 3 x 3 with zero padding or 1 x 1 x 1, as an implicit
   matrix product: each tap (weight position) is a shift of the flat array, so that no matrix of
   shifted maps is formed. Letters: I input and O output channels, T taps (27 or 1). Each element is
   always summed in the same order: the result does not depend on the number of threads. n_threads
   0: the OpenMP default. */
#pragma once

#include <stdbool.h>

#include "fmap.h"
#include "sdm/internal/sdmnn.h"

typedef struct sdm_conv {
    size_t in, out, taps; /* I, O, T; weights w[O][I][T], taps [z][y][x] */
} sdm_conv;

/* Number of floats of the packed weights. Packed weights are in the order in which the kernels read
   them; it differs between instruction sets, so that they are never stored in a file. */
size_t sdm_conv_packed_count(sdm_conv c);

/* packed[sdm_conv_packed_count(c)] = the weights w[O][I][T]. With `transposed`:
   packed[sdm_conv_packed_count(sdm_conv_opposite(c))] = the weights, with mirrored taps, of the
   opposite convolution, which computes dx[I] from dy[O]. */
void sdm_conv_pack(sdm_conv c, bool transposed, const float *w, float *packed);
static inline sdm_conv sdm_conv_opposite(sdm_conv c) { return (sdm_conv){c.out, c.in, c.taps}; }

/* Operations on the results of the convolution, applied while the results are in the cache. */
typedef struct sdm_conv_finish {
    const float *bias; /* [O], or NULL */
    int activation;    /* `kind` of sdm_activate(); -1: none */
    float *slope; /* feature map of O channels, set to the derivative of the activation; or NULL */
} sdm_conv_finish;

/* y[O] = activation(w * x[I] + bias). y must not overlap x. */
void sdm_conv_apply(const sdm_fmap *g, sdm_conv c, const float *packed, const float *x,
                    sdm_conv_finish finish, float *y, int n_threads);

/* y[O] = activation(y[O] + bias), in place. */
void sdm_conv_finish_maps(const sdm_fmap *g, size_t channels, sdm_conv_finish finish, float *y,
                          int n_threads);

/* Gradient by the weights: dw[O][I][T] += sum over voxels of dy[O] * x[I] shifted by the tap;
   db[O] += sum over voxels of dy[O]. */
void sdm_conv_gradient(const sdm_fmap *g, sdm_conv c, const float *x, const float *dy, float *dw,
                       float *db, int n_threads);

/* An implementation of the functions above. sdm_conv_native() consists of these functions
   themselves. */
struct sdm_conv_backend {
    const char *name;
    size_t (*packed_count)(sdm_conv c);
    void (*pack)(sdm_conv c, bool transposed, const float *w, float *packed);
    void (*apply)(const sdm_fmap *g, sdm_conv c, const float *packed, const float *x,
                  sdm_conv_finish finish, float *y, int n_threads);
    void (*gradient)(const sdm_fmap *g, sdm_conv c, const float *x, const float *dy, float *dw,
                     float *db, int n_threads);
};
