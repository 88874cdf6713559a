/* The interface between the training loop of the direct kinds (direct.c) and their networks. */
#pragma once

#include "state/trainer.h"

/* The maps of one step: slots[n] of t->data, in map order [nz][ny][nx]. */
typedef struct direct_batch {
    size_t n;
    const size_t *slots;
    uint64_t step; /* number of the step in the run; selects the random numbers */
} direct_batch;

typedef struct direct_network {
    /* Designs the network from the configuration and the data and allocates what a step needs;
     *n_weights = number of its weights. The caller calls dispose(*network) also after an error.
     */
    sdm_status (*create)(const trainer *t, void **network, size_t *n_weights, sdm_error *err);
    /* NULL does nothing. */
    void (*dispose)(void *network);
    /* Random initial weights w[n_weights]; counter-based (STREAM_INIT). */
    void (*init)(const trainer *t, const void *network, float *w);
    /* gradient[n_weights] = derivative of the batch's loss at w, overwritten. *mse = mean square
       error of the batch, mm^2, whatever the loss (numerics/loss.h). trainer_threads(t) threads;
       the same bits for any number of them. */
    sdm_status (*gradient)(const trainer *t, void *network, const float *w, const direct_batch *b,
                           float *gradient, double *mse, sdm_error *err);
    /* *mse = mean square error (mm^2) over all voxels or a fixed sample of them, on the held-out
       shapes or, if `training`, on maps of the pool (trainer_dataset_measured()). */
    sdm_status (*evaluate)(const trainer *t, void *network, const float *w, bool training,
                           double *mse, sdm_error *err);
    /* *bytes = new model file with weights w; free with sdm_free(). */
    sdm_status (*build)(const trainer *t, const void *network, const float *w,
                        const sdm_model_info *info, uint8_t **bytes, size_t *size, sdm_error *err);
} direct_network;

extern const direct_network trainer_network_point; /* deepsdf and imnet */
extern const direct_network trainer_network_sdmnn;
