/* The opened model as nn/ sees it. */
#ifndef SDM_MODEL_INTERNAL_H
#define SDM_MODEL_INTERNAL_H

#include "sdm/pod.h"

struct sdm_model {
    sdm_model_info info;
    sdm_model_param *params;
    char **option_names, **option_values;
    char *config;
    uint8_t *file; /* the whole file; the weights below point into it */

    sdm_pod_arch arch;
    bool half;
    sdm_pod_block *blocks;
    uint8_t *exponents;                    /* [max(F, 1 + I)][P] */
    const float *layer[SDM_POD_MAX_DEPTH]; /* tiled */
    const float *bias[SDM_POD_MAX_DEPTH];
    const void *head;  /* tiled, float or half */
    const void *basis; /* tiled, block after block */
    const float *mean; /* block order */
    size_t max_block_voxels, max_rank;
};

/* Bytes of the sections that hold the weights, for a given architecture. */
size_t sdm_pod_mlp_floats(const sdm_pod_arch *a);
size_t sdm_pod_basis_count(const sdm_pod_block *blocks, size_t n_blocks);

static inline size_t sdm_pod_layer_inputs(const sdm_pod_arch *a, size_t layer)
{
    return layer ? a->width : a->n_inputs;
}

#endif
