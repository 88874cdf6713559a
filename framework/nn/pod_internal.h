/* The opened pod network. */
#ifndef SDM_POD_INTERNAL_H
#define SDM_POD_INTERNAL_H

#include "model_kind.h"
#include "sdm/kernels.h"
#include "sdm/pod.h"

typedef struct pod_network {
    sdm_pod_arch arch;
    sdm_pod_type type;
    sdm_pod_block *blocks;
    uint32_t *outputs;  /* [blocks] V_b */
    size_t *weights_at; /* [blocks] where the weights of a block begin in basis */
    size_t coefficients_at[SDM_POD_MAX_LEVELS +
                           1]; /* where the coefficients of a level begin among all; the last: their number C */
    size_t max_group
        [SDM_POD_MAX_LEVELS]; /* most coefficients of a level that are made together: of the highest those of a block, else
                                             those of all children of a block */
    /* Bytes only (pod_quantise.h). */
    uint32_t *coarse;                     /* [blocks + 1] the last: of the head */
    const uint32_t *order;                /* [L] */
    const float *factor;                  /* [C + L] */
    int limit[SDM_POD_MAX_LEVELS + 1];    /* of inputs of a level as integers; the last: of the head */
    uint8_t *exponents;                   /* [max(F, 1 + I)][P] */
    const float *bias[SDM_POD_MAX_DEPTH]; /* [W] */
    const float *mean;                    /* block order */
    /* Panels (sdm/kernels.h), the MLP's half when the others are bytes. The basis: a block of the highest level, then those below it, depth first, which is the
       order in which they are read. */
    const void *layer[SDM_POD_MAX_DEPTH], *head, *basis;
    size_t max_outputs[SDM_POD_MAX_LEVELS];
} pod_network;

/* Number of weights of the layers of the MLP, without the biases. */
size_t sdm_pod_mlp_count(const sdm_pod_arch *a);

/* Bytes of a stored number. */
static inline size_t sdm_pod_size(sdm_pod_type type) { return type == SDM_POD_F32 ? 4 : type == SDM_POD_F16 ? 2 : 1; }

/* Type of the MLP's weights when those of head and bases are `type`. */
static inline sdm_pod_type sdm_pod_mlp_type(sdm_pod_type type) { return type == SDM_POD_I8 ? SDM_POD_F16 : type; }

/* y[rows][ldy] = x[rows][ldx] times float or half weights that begin at `at`, as sdm_panel_*(); and the transpose. */
void sdm_pod_product(sdm_pod_type type, size_t rows, size_t outputs, size_t k, const void *weights, size_t at,
                     const float *x, size_t ldx, float *y, size_t ldy);
void sdm_pod_product_back(sdm_pod_type type, size_t outputs, size_t k, const void *weights, size_t at, const float *y,
                          float *x);

/* Stored numbers of a matrix of `outputs` x k; n_coarse: for bytes. */
size_t sdm_pod_count_weights(sdm_pod_type type, size_t outputs, size_t n_coarse, size_t k);

/* at[blocks] = where the weights of each block begin, depth first; coarse[blocks]: for bytes. Returns their number. */
size_t sdm_pod_place_weights(sdm_pod_type type, const sdm_pod_levels *levels, const sdm_pod_block *blocks,
                             const uint32_t *coarse, size_t *at);

/* at[l] = number of coefficients of the levels below l, after sdm_pod_number(); the last: of all. */
void sdm_pod_place_coefficients(const sdm_pod_levels *levels, const sdm_pod_block *blocks,
                                size_t at[SDM_POD_MAX_LEVELS + 1]);

/* Columns of the head with a coarse part; 0 when weights are not bytes. */
static inline size_t sdm_pod_head_coarse(const pod_network *m)
{
    return m->coarse ? m->coarse[m->arch.levels.first[m->arch.levels.n]] : 0;
}

static inline size_t sdm_pod_layer_inputs(const sdm_pod_arch *a, size_t layer)
{
    return layer ? a->width : a->n_inputs;
}

/* pod_latent.c: parameters to latent variables and back. Letters as in sdm/pod.h; D directions. */
typedef struct pod_latent {
    float *phi;   /* [R][n_poly] all products and their derivatives along the directions */
    float *h[2];  /* [R][padded W] of a layer and of the one before */
    float *slope; /* [depth][padded W] */
    float *dphi;  /* [P][n_poly] derivatives with respect to each parameter */
} pod_latent;

/* Sets the pointers into memory[] (NULL: none) for R rows of z; returns the floats needed. */
size_t sdm_pod_latent_carve(const pod_network *m, size_t rows, float *memory, pod_latent *w);

/* z[n][L]: latent variables at p[n][P]; of a single point their derivatives along direction[D][P] too, z[1 + D][L]. */
void sdm_pod_latent(const sdm_model *model, const double *p, size_t n, size_t n_directions, const double *direction,
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
