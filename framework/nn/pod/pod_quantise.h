/* Weights of a pod network as bytes (sdm_panel_i8() in sdm/kernels.h). */
#ifndef SDM_POD_QUANTISE_H
#define SDM_POD_QUANTISE_H

#include "pod_internal.h"

/* Coefficients of all levels stand one after another, C in number, level l from coefficients_at[l]
 * on. */
typedef struct pod_integers {
    uint32_t *
        wide; /* [blocks + 1] how many of the first columns have two bytes; the last: of the head */
    uint32_t limit[SDM_POD_MAX_LEVELS +
                   1]; /* largest inputs of the blocks of a level; the last: of the head */
    uint32_t *order;   /* [L] latent variable of each column of the head */
    float *factor; /* [C + L] what a coefficient is multiplied with before it goes into its block;
                      columns of the head */
    uint32_t layer_limit[SDM_POD_MAX_DEPTH]; /* of inputs of a layer of the MLP */
    float *layer_scale;                      /* [depth][W] of its rows */
    int16_t *mlp;                            /* [depth][W][I or W] */
    float *quantum; /* [blocks] value of 1 of the integers that go into a block */
    int16_t *head;  /* [K][L] */
    int16_t *basis; /* [V_b][k_b], block after block as in sdm_pod_weights.basis */
} pod_integers;

/* Integers for the weights of `spec`. Each matrix is rows times integers times columns: the scales
   of the columns are in `factor`, those of the rows too, in that of the coefficient which the row
   gives. Weights that are not finite make factors that are not. SDM_E_NOMEM.
   sdm_pod_integers_dispose() also after an error. */
sdm_status sdm_pod_quantise(const sdm_pod_spec *spec, pod_integers *out, sdm_error *err);
void sdm_pod_integers_dispose(pod_integers *q);

#endif
