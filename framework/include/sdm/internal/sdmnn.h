/* The `sdmnn` network: dense layers give a coarse volume, and an encoder-decoder of 3-D
   convolutions with skip connections turns it into the map (Wang et al. 2020, after the U-Net of
   Ronneberger et al. 2015).

     h    = f(dense(parameters scaled to [-1, 1]))           W units
     v    = dense(h), up-sampled by `block` to the grid      one channel
     down: for levels 0 .. D - 1: 2 convolutions to C_l channels, max pooling by 2;
           at level D: 2 convolutions to C_D channels
     up:   for levels D - 1 .. 0: convolution 1 x 1 x 1 to C_l channels, up-sampling by 2,
           concatenation with the result of this level on the way down, 2 convolutions to C_l
           channels
     map  = convolution 1 x 1 x 1 to one channel, mm

   Unless stated otherwise, a convolution is 3 x 3 x 3 with zero padding and is followed by the
   activation f; C_l = min(C 2^l, 512). The size of a level is half the size of the level before,
   rounded up, so that the grid may have any size and no voxel outside the grid is computed.
   Drop-out acts on the second convolution of levels D - 1 and D on the way down, in training only.

   Letters: P parameters, B batch, V voxels. */
#pragma once

#include <stdbool.h>

#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_SDMNN_MAX_DEPTH 6
#define SDM_SDMNN_MAX_CHANNELS 512

typedef struct sdm_sdmnn_arch {
    size_t n_params; /* P */
    size_t n[3];     /* voxels along x, y, z */
    size_t depth;    /* D poolings, 1 .. SDM_SDMNN_MAX_DEPTH */
    size_t channels; /* C, the channels of level 0, 1 .. SDM_SDMNN_MAX_CHANNELS */
    size_t width;    /* W, 1 .. 65536 */
    size_t block;    /* voxels along the edge of a cell of v, 1 .. 64 */
    int activation;  /* f: `kind` of sdm_activate(), 0 .. 2 */
    double dropout;  /* probability of drop-out, 0 <= dropout < 1 */
} sdm_sdmnn_arch;

/* Checks that all members lie in the ranges above, with 1 <= P <= 65536 and 1 <= n[i] <= 2^20, that
   voxels times channels do not overflow, and that every level except D has more than one voxel.
   SDM_E_ARG names the first violation. [any thread] */
sdm_status sdm_sdmnn_check(const sdm_sdmnn_arch *a, sdm_error *err);

/* Number of weights. They are stored one after another, first for the two dense layers, then for
   each convolution in the order above: w[outputs][inputs] (of a convolution:
   w[outputs][inputs][z][y][x]), then bias[outputs]. The architecture must have passed
   sdm_sdmnn_check(). [any thread] */
size_t sdm_sdmnn_count(const sdm_sdmnn_arch *a);

/* Number of multiply-adds for one map. The architecture must have passed sdm_sdmnn_check().
   [any thread] */
double sdm_sdmnn_work(const sdm_sdmnn_arch *a);

/* weights[sdm_sdmnn_count(a)] = initial weights. Unless f is tanh or C is 1, the first maps are
   close to mean[V] (mm) at all parameters, but coarse: one value for each cell of v. mean NULL:
   zero. The biases of v are the means over its cells. The convolutions of level 0 pass v on:
   channels 0 and 1 of each are f(v) and f(-v), the difference of which is v (Balduzzi et al. 2017,
   "The shattered gradients problem": looks-linear weights). All other weights are normal random
   numbers of variance 2 / inputs (He et al. 2015), in the second dense layer 0.01 / inputs and in
   the last layer 1 / inputs. The biases of the first dense layer have variance 1; all others are
   zero. The random numbers depend on (seed, stream) only. [any thread] */
void sdm_sdmnn_init(const sdm_sdmnn_arch *a, const float *mean, uint64_t seed, uint64_t stream,
                    float *weights);

/* An implementation of the convolutions. Its result does not depend on the number of threads; two
   implementations differ by rounding. */
typedef struct sdm_conv_backend sdm_conv_backend;

/* The implementation of this library. [any thread] */
const sdm_conv_backend *sdm_conv_native(void);

/* An implementation that uses oneDNN for the layers where it is faster, else sdm_conv_native(). It
   is meant for the trainer: it belongs to the library sdm_dnnl (build option SDM_DNNL), not to
   libsdmgen. [any thread] */
const sdm_conv_backend *sdm_conv_dnnl(void);

/* A network in training, with its feature maps and packed weights. Only one thread at a time may
   use it. */
typedef struct sdm_sdmnn sdm_sdmnn;

/* *out = a network for the forward pass and for gradients of up to `batch` maps (0: forward pass
   only), to be freed with sdm_sdmnn_free(), which accepts NULL; *out is NULL on error. backend NULL
   selects sdm_conv_native(). SDM_E_ARG as in sdm_sdmnn_check(), SDM_E_NOMEM. */
sdm_status sdm_sdmnn_create(const sdm_sdmnn_arch *a, size_t batch, const sdm_conv_backend *backend,
                            sdm_sdmnn **out, sdm_error *err);
void sdm_sdmnn_free(sdm_sdmnn *net);

/* Sets weights[sdm_sdmnn_count()] for the functions below. The array is packed now and is also read
   by these functions: it must stay valid and unchanged until the next sdm_sdmnn_set(). */
void sdm_sdmnn_set(sdm_sdmnn *net, const float *weights);

/* values[V] = the map (mm) at x[P], the parameters scaled to [-1, 1]; without drop-out. n_threads
   0: the OpenMP default. */
void sdm_sdmnn_forward(sdm_sdmnn *net, const float *x, float *values, int n_threads);

/* Loss function for map `index` of a batch: returns the loss of values[V] and writes
   dvalues[V] = d loss / d values. */
typedef double (*sdm_sdmnn_loss)(void *user, size_t index, const float *values, float *dvalues);

/* Returns the sum of the losses of a batch x[B][P], B <= `batch` of sdm_sdmnn_create(), and writes
   gradient[sdm_sdmnn_count()], the derivative of this sum by the weights. `loss` is called in the
   calling thread with index = 0 .. B - 1. The drop-out of map b uses the random numbers of
   (seed, stream, draw + b): they never repeat if the caller increases `draw` by B with each call.
   The result does not depend on n_threads (0: the OpenMP default). */
double sdm_sdmnn_gradient(sdm_sdmnn *net, size_t batch, const float *x, sdm_sdmnn_loss loss,
                          void *user, uint64_t seed, uint64_t stream, uint64_t draw,
                          float *gradient, int n_threads);

/* Content of a model file. `info` gives shape, parameters, options, grid, accuracy, training and
   configuration; the size of its grid equals arch.n. All pointers belong to the caller. */
typedef struct sdm_sdmnn_spec {
    const sdm_model_info *info;
    sdm_sdmnn_arch arch;
    const float *weights; /* [sdm_sdmnn_count()] */
    bool half;            /* store the second dense matrix and the convolutions as halves */
} sdm_sdmnn_spec;

/* *bytes = a model file of *size bytes, to be freed with sdm_free() and written with
   sdm_container_write(). SDM_E_ARG as in sdm_sdmnn_check(), SDM_E_NOMEM. [any thread] */
sdm_status sdm_sdmnn_build(const sdm_sdmnn_spec *spec, uint8_t **bytes, size_t *size,
                           sdm_error *err);

#ifdef __cplusplus
}
#endif
