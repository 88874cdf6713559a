/* Integer weights of a pod network, for sdm_panel_i8(). Words and letters as in pod_internal.h. */
#pragma once

#include "pod_internal.h"

/* The integer weights of all matrices, row-major, with their scales. wide, limit, order, factor and
   quantum are the members of pod_network with the same names. */
typedef struct pod_integers {
    uint32_t *wide;                          /* [blocks + 1] */
    uint32_t limit[SDM_POD_MAX_LEVELS + 1];  /* [levels + 1] */
    uint32_t *order;                         /* [L] */
    float *factor;                           /* [C + L] */
    uint32_t layer_limit[SDM_POD_MAX_DEPTH]; /* limit of the inputs of each layer of the MLP */
    float *layer_scale;                      /* [depth][W] row scales of the MLP */
    int16_t *mlp;                            /* [depth][W][I or W] */
    float *quantum;                          /* [blocks] */
    int16_t *head;                           /* [K][L], columns in `order` */
    int16_t *basis; /* [V_b][k_b], block after block as in sdm_pod_weights.basis */
} pod_integers;

/* *out = the weights of `spec` as integers. Rounding adds an error to the map; its mean square,
   estimated with the survey, stays below 5e-7 * (variance of the map), because as many columns as
   this needs are made wide. Weights that are not finite give scales that are not finite.
   SDM_E_NOMEM. Call sdm_pod_integers_dispose() after success and after an error. */
sdm_status sdm_pod_quantise(const sdm_pod_spec *spec, pod_integers *out, sdm_error *err);
void sdm_pod_integers_dispose(pod_integers *q);
