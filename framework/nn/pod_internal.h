/* The opened pod network. */
#ifndef SDM_POD_INTERNAL_H
#define SDM_POD_INTERNAL_H

#include "model_kind.h"
#include "sdm/pod.h"

typedef struct pod_network {
    sdm_pod_arch arch;
    bool half;
    sdm_pod_block *blocks;
    uint32_t *outputs;                    /* [blocks] V_b */
    size_t *weights_at;                   /* [blocks] where the weights of a block begin in basis */
    uint8_t *exponents;                   /* [max(F, 1 + I)][P] */
    const float *bias[SDM_POD_MAX_DEPTH]; /* [W] */
    const float *mean;                    /* block order */
    /* Panels (sdm/kernels.h), float or half. The basis: a block of the highest level, then those below it, depth first, which is the
       order in which they are read. */
    const void *layer[SDM_POD_MAX_DEPTH], *head, *basis;
    size_t max_outputs[SDM_POD_MAX_LEVELS];
} pod_network;

/* Number of weights of the layers of the MLP, without the biases. */
size_t sdm_pod_mlp_count(const sdm_pod_arch *a);

/* y[rows][ldy] = x[rows][ldx] times weights that begin at `at`, as sdm_panel_*(); and the transpose. */
void sdm_pod_product(bool half, size_t rows, size_t outputs, size_t k, const void *weights, size_t at, const float *x,
                     size_t ldx, float *y, size_t ldy);
void sdm_pod_product_back(bool half, size_t outputs, size_t k, const void *weights, size_t at, const float *y,
                          float *x);

/* at[blocks] = where the weights of each block begin, depth first; returns their number. */
size_t sdm_pod_place_weights(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t *at);

static inline size_t sdm_pod_layer_inputs(const sdm_pod_arch *a, size_t layer)
{
    return layer ? a->width : a->n_inputs;
}

/* pod_latent.c: parameters to latent variables and back. Letters as in sdm/pod.h; D directions. */
typedef struct pod_latent {
    float *phi;   /* [1 + D][n_poly] all products and their derivatives along the directions */
    float *h[2];  /* [1 + D][padded W] of a layer and of the one before */
    float *slope; /* [depth][padded W] */
    float *dphi;  /* [P][n_poly] derivatives with respect to each parameter */
} pod_latent;

/* Sets the pointers into memory[] (NULL: none); returns the floats needed. */
size_t sdm_pod_latent_carve(const pod_network *m, size_t directions, float *memory, pod_latent *w);

/* z[1 + D][L]: latent variables at p[P] and their derivatives along direction[D][P]. */
void sdm_pod_latent(const sdm_model *model, const double *p, size_t n_directions, const double *direction,
                    const pod_latent *w, float *z);

/* gradient[P] = (dz / dp)^T dz[L], at the parameters p of the last sdm_pod_latent() with this w. */
void sdm_pod_latent_back(const sdm_model *model, const double *p, const pod_latent *w, const float *dz,
                         double *gradient);

/* pod_forward.c */
size_t sdm_pod_scratch_bytes(const sdm_model *m, size_t n, int n_threads);
void sdm_pod_forward(const sdm_model *m, const double *params, size_t n, float *values, void *scratch, int n_threads);
size_t sdm_pod_jacobian_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_pod_jacobian(const sdm_model *m, const double *params, float *values, float *jacobian, void *scratch,
                      int n_threads);
size_t sdm_pod_jvp_scratch_bytes(const sdm_model *m, int n_threads);
void sdm_pod_jvp(const sdm_model *m, const double *params, const double *direction, float *values, float *tangent,
                 void *scratch, int n_threads);
size_t sdm_pod_vjp_scratch_bytes(const sdm_model *m);
void sdm_pod_vjp(const sdm_model *m, const double *params, const float *adjoint, double *gradient, void *scratch);

#endif
