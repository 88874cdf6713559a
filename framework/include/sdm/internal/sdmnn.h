/* The `sdmnn` network: dense layers give a coarse volume, an encoder-decoder of 3-D convolutions
   with merged layers makes the map of it (Wang et al. 2020, after the U-Net of Ronneberger et al.
   2015).

     h    = f(dense(parameters scaled to [-1, 1]))                      W units
     v    = dense(h), up-sampled by `block` to the grid                 one channel
     down = for levels 0 .. D - 1: 2 convolutions of C_l channels, max pooling by 2; at level D: 2
   convolutions up   = for levels D - 1 .. 0: convolution 1 x 1 x 1 to C_l channels, up-sampling by
   2, merging with the level's maps of the way down, 2 convolutions of C_l channels map  =
   convolution 1 x 1 x 1 to one channel, mm

   Convolutions are 3 x 3 x 3 with zero padding and followed by the activation f where nothing else
   is said; C_l = min(C 2^l, 512). Sizes of a level are half of those before, rounded up, so any
   grid will do and no voxel outside of it is computed. Drop-out acts on the second convolution of
   the two deepest levels of the way down, in training only. Letters: P parameters, B batch, V
   voxels. */
#ifndef SDM_SDMNN_H
#define SDM_SDMNN_H

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
    size_t depth;    /* D poolings and merges, 1 .. SDM_SDMNN_MAX_DEPTH */
    size_t channels; /* C of level 0, 1 .. SDM_SDMNN_MAX_CHANNELS */
    size_t width;    /* W, 1 .. 65536 */
    size_t block;    /* voxels along the edge of a cell of v, 1 .. 64 */
    int activation;  /* of sdm_activate() */
    double dropout;  /* probability, 0 <= dropout < 1 */
} sdm_sdmnn_arch;

/* Ranges above, and every level but the deepest has more than one voxel. SDM_E_ARG names what is
 * wrong. [any thread] */
sdm_status sdm_sdmnn_check(const sdm_sdmnn_arch *a, sdm_error *err);

/* Number of weights, which lie one after another: for the two dense layers and then each
   convolution in the order above w[outputs][inputs] (convolutions [outputs][inputs][z][y][x]),
   bias[outputs]. The architecture must have passed sdm_sdmnn_check(). [any thread] */
size_t sdm_sdmnn_count(const sdm_sdmnn_arch *a);

/* Multiply-adds of one map. */
double sdm_sdmnn_work(const sdm_sdmnn_arch *a);

/* Random start: normal with variance 2 / inputs (He et al. 2015), 1 / inputs where no activation
   follows; biases zero. Counter-based on (seed, stream). */
void sdm_sdmnn_init(const sdm_sdmnn_arch *a, uint64_t seed, uint64_t stream, float *weights);

/* How convolutions are computed. Each gives the same bits for any number of threads; two of them
 * differ by rounding. */
typedef struct sdm_conv_backend sdm_conv_backend;
const sdm_conv_backend *sdm_conv_native(void);
/* oneDNN where it is faster, for the trainer: in the library sdm_dnnl (option SDM_DNNL of the
 * build), not in libsdmgen. [any thread] */
const sdm_conv_backend *sdm_conv_dnnl(void);

/* A network in training: memory for the maps between the layers. One thread at a time. */
typedef struct sdm_sdmnn sdm_sdmnn;

/* Memory for the forward pass and for gradients of up to `batch` maps, 0: none. backend NULL:
   sdm_conv_native(). SDM_E_ARG as sdm_sdmnn_check(), SDM_E_NOMEM. Free with sdm_sdmnn_free(); NULL
   is fine. */
sdm_status sdm_sdmnn_create(const sdm_sdmnn_arch *a, size_t batch, const sdm_conv_backend *backend,
                            sdm_sdmnn **out, sdm_error *err);
void sdm_sdmnn_free(sdm_sdmnn *net);

/* The weights for what follows; they are read until the next call and must not change before it. */
void sdm_sdmnn_set(sdm_sdmnn *net, const float *weights);

/* values[V] = the map at x[P], scaled parameters; no drop-out. n_threads 0: the OpenMP default. */
void sdm_sdmnn_forward(sdm_sdmnn *net, const float *x, float *values, int n_threads);

/* Loss of map `index` of a batch: reads values[V], writes its derivative dvalues[V], returns its
 * part of the loss. */
typedef double (*sdm_sdmnn_loss)(void *user, size_t index, const float *values, float *dvalues);

/* Loss of a batch x[B][P], summed in order, and its gradient[sdm_sdmnn_count], overwritten.
   Drop-out takes its random numbers from (seed, stream, draw .. draw + B): numbers that never
   repeat in a run. The same bits for any number of threads. */
double sdm_sdmnn_gradient(sdm_sdmnn *net, size_t batch, const float *x, sdm_sdmnn_loss loss,
                          void *user, uint64_t seed, uint64_t stream, uint64_t draw,
                          float *gradient, int n_threads);

/* Everything a model file is made from. `info` gives names, ranges, grid, accuracy, provenance; the
   grid's size is that of the architecture. */
typedef struct sdm_sdmnn_spec {
    const sdm_model_info *info;
    sdm_sdmnn_arch arch;
    const float *weights;
    bool half; /* matrices and convolutions in half precision */
} sdm_sdmnn_spec;

/* Builds a model file in memory (sdm_free()); write it with sdm_container_write(). */
sdm_status sdm_sdmnn_build(const sdm_sdmnn_spec *spec, uint8_t **bytes, size_t *size,
                           sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
