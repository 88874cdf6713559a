/* Convolution of feature maps (fmap.h), 3 x 3 x 3 with "same" zero padding or 1 x 1 x 1, as an
   implicit matrix product: every tap is a shift of the flat array, so nothing is unrolled in
   memory. Letters: I input and O output channels, T taps (27 or 1). One element is always summed in
   the same order: the same bits for any number of threads. */
#ifndef SDM_CONV_H
#define SDM_CONV_H

#include <stdbool.h>

#include "fmap.h"
#include "sdm/internal/sdmnn.h"

typedef struct sdm_conv {
    size_t in, out, taps; /* weights w[out][in][taps], taps in the order z, y, x with x fastest */
} sdm_conv;

/* Weights in the order of the kernels, which differs between instruction sets: for memory, never
 * for a file. */
size_t sdm_conv_packed_count(sdm_conv c);
/* `transposed`: for sdm_conv_apply of the opposite convolution, which takes dy[O] to dx[I]: taps
 * mirrored, in and out exchanged. */
void sdm_conv_pack(sdm_conv c, bool transposed, const float *w, float *packed);
static inline sdm_conv sdm_conv_opposite(sdm_conv c) { return (sdm_conv){c.out, c.in, c.taps}; }

/* What follows the sum, in one pass over the output while it is in the cache. */
typedef struct sdm_conv_finish {
    const float *bias; /* [O], or NULL */
    int activation;    /* of sdm_activate(), or -1: none */
    float *slope;      /* feature map of O channels: its derivative, or NULL */
} sdm_conv_finish;

/* y[O] = activation(w * x[I] + bias). y must not overlap x. n_threads 0: the OpenMP default. */
void sdm_conv_apply(const sdm_fmap *g, sdm_conv c, const float *packed, const float *x,
                    sdm_conv_finish finish, float *y, int n_threads);

/* The finish alone, in place on the sums y[O]. */
void sdm_conv_finish_maps(const sdm_fmap *g, size_t channels, sdm_conv_finish finish, float *y,
                          int n_threads);

/* dw[O][I][T] += sum over voxels of dy[O] x[I] shifted; db[O] += sum of dy[O]. */
void sdm_conv_gradient(const sdm_fmap *g, sdm_conv c, const float *x, const float *dy, float *dw,
                       float *db, int n_threads);

/* The four functions above, or others that do the same in another way (sdm_conv_native() in
 * sdm/sdmnn.h gives those above). */
struct sdm_conv_backend {
    const char *name;
    size_t (*packed_count)(sdm_conv c);
    void (*pack)(sdm_conv c, bool transposed, const float *w, float *packed);
    void (*apply)(const sdm_fmap *g, sdm_conv c, const float *packed, const float *x,
                  sdm_conv_finish finish, float *y, int n_threads);
    void (*gradient)(const sdm_fmap *g, sdm_conv c, const float *x, const float *dy, float *dw,
                     float *db, int n_threads);
};

/* Multiply-adds of one pass over the voxels, padding not counted. */
double sdm_conv_work(const sdm_fmap *g, sdm_conv c);

#endif
