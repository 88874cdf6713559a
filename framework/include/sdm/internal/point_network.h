/* Point networks: a multi-layer perceptron gives the signed distance at one point of one shape. A
   map takes one pass for each voxel.

     u     = [x, q]                       x: parameters scaled to [-1, 1],
                                          q = (point - centre) / radius
     h_0   = f(W_0 u + b_0)
     h_l   = f(W_l [h_(l-1), u] + b_l)    for layers with a skip connection from u,
             f(W_l h_(l-1) + b_l)         for the other layers
     value = scale * g(w h + b)           mm; h: output of the last layer, g: identity or tanh

   `deepsdf`: decoder of Park et al. 2019 (8 layers of 512, ReLU, skip connection to layer 4, tanh).
   `imnet`: decoder of Chen and Zhang 2019 (5 layers of 2048 down to 128, leaky ReLU, skip
   connections to all layers).

   Letters: P parameters, U = P + 3 elements of u, W_l also the width of layer l, K_l the number of
   inputs of layer l, H the width of the last layer. */
#pragma once

#include <stdbool.h>

#include "sdm/model.h"

#ifdef __cplusplus
extern "C" {
#endif

#define SDM_POINT_MAX_DEPTH 16
#define SDM_POINT_MAX_WIDTH 4096

typedef struct sdm_point_arch {
    size_t n_params;
    size_t depth; /* hidden layers, 1..SDM_POINT_MAX_DEPTH */
    size_t width[SDM_POINT_MAX_DEPTH];
    uint32_t skip;    /* bit l: skip connection from u to layer l, l >= 1 */
    int activation;   /* kind of sdm_activate() */
    bool tanh_output; /* g is tanh, else the identity */
    double centre[3]; /* mm, LPS */
    double radius;    /* mm, > 0 */
    double scale;     /* mm, > 0 */
} sdm_point_arch;

/* Number of inputs of layer l that come from h_(l-1), whether u enters layer l (it enters layer 0
   and the layers with a skip connection), and the number of all inputs, K_l. */
static inline size_t sdm_point_hidden(const sdm_point_arch *a, size_t l)
{
    return l ? a->width[l - 1] : 0;
}
static inline bool sdm_point_takes_input(const sdm_point_arch *a, size_t l)
{
    return l == 0 || (a->skip >> l & 1);
}
static inline size_t sdm_point_inputs(const sdm_point_arch *a, size_t l)
{
    return sdm_point_hidden(a, l) + (sdm_point_takes_input(a, l) ? a->n_params + 3 : 0);
}

/* Number of weights. They are stored one after another: for each hidden layer the matrix
   W_l[W_l][K_l] (first the columns that multiply h_(l-1), then those that multiply u) and b_l[W_l];
   then w[H] and b. */
size_t sdm_point_count(const sdm_point_arch *a);

/* Number of multiply-adds for one point. */
size_t sdm_point_macs(const sdm_point_arch *a);

/* Content of a model file. `info` gives shape, parameters, options, grid, accuracy, training and
   configuration; kind: "deepsdf" or "imnet". All pointers belong to the caller. */
typedef struct sdm_point_spec {
    const sdm_model_info *info;
    const char *kind;
    sdm_point_arch arch;
    const float *weights; /* [sdm_point_count()] */
    bool half;            /* store the matrices between hidden layers in half precision */
} sdm_point_spec;

/* *bytes = a model file of *size bytes, to be freed with sdm_free() and written with
   sdm_container_write(). SDM_E_ARG: unknown kind. SDM_E_NOMEM. [any thread] */
sdm_status sdm_point_build(const sdm_point_spec *spec, uint8_t **bytes, size_t *size,
                           sdm_error *err);

#ifdef __cplusplus
}
#endif
