/* Point networks: a multi-layer perceptron gives the signed distance at one point of one shape; a
   map takes one pass a voxel.

     u     = [x, q]                        x parameters scaled to [-1, 1], q = (point - centre) /
   radius h_0   = f(W_0 u + b_0) h_l   = f(W_l [h_(l-1), u] + b_l)     where the input enters again,
   else f(W_l h_(l-1) + b_l) value = scale g(w h + b)              g the identity or tanh

   `deepsdf`: decoder of Park et al. 2019 (8 layers of 512, ReLU, the input again at layer 4, tanh).
   `imnet`: decoder of Chen and Zhang 2019 (5 layers of 2048 down to 128, leaky ReLU, the input
   again at each).

   Letters: P parameters, U = P + 3 inputs, W_l width of layer l, K_l its inputs, H = W of the last
   layer. */
#ifndef SDM_POINT_NETWORK_H
#define SDM_POINT_NETWORK_H

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
    uint32_t again;   /* bit l: the input enters layer l again, l >= 1 */
    int activation;   /* of sdm_activate() */
    bool tanh_output; /* g */
    double centre[3]; /* mm, LPS */
    double radius;    /* mm, > 0 */
    double scale;     /* mm, > 0 */
} sdm_point_arch;

/* K_l = [W_(l-1)] + [U]: what comes from the layer before, and whether the input follows it. */
static inline size_t sdm_point_hidden(const sdm_point_arch *a, size_t l)
{
    return l ? a->width[l - 1] : 0;
}
static inline bool sdm_point_takes_input(const sdm_point_arch *a, size_t l)
{
    return l == 0 || (a->again >> l & 1);
}
static inline size_t sdm_point_inputs(const sdm_point_arch *a, size_t l)
{
    return sdm_point_hidden(a, l) + (sdm_point_takes_input(a, l) ? a->n_params + 3 : 0);
}

/* Number of weights: for each hidden layer W_l[W_l][K_l] (from the layer before, then from the
 * input) and b_l[W_l]; then w[H], b. */
size_t sdm_point_count(const sdm_point_arch *a);

/* Multiply-adds of one point. */
size_t sdm_point_macs(const sdm_point_arch *a);

/* Everything a model file is made from. `info` gives names, ranges, grid, accuracy, provenance;
 * kind: "deepsdf" or "imnet". */
typedef struct sdm_point_spec {
    const sdm_model_info *info;
    const char *kind;
    sdm_point_arch arch;
    const float *weights; /* [sdm_point_count()] */
    bool half;            /* matrices between hidden layers in half precision */
} sdm_point_spec;

/* Builds a model file in memory (sdm_free()); write it with sdm_container_write(). SDM_E_ARG:
 * another kind; SDM_E_NOMEM. */
sdm_status sdm_point_build(const sdm_point_spec *spec, uint8_t **bytes, size_t *size,
                           sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
