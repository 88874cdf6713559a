/* What the trainer asks of a kind of network.

   train_kind: the way from exact maps to weights. There are two: pod (pod_kind.c, with bases.c,
   fit.c, refine.c) and direct.c, for networks that learn by gradients on the maps themselves.
   direct_network: such a network; one table each, listed in direct.c. */
#ifndef SDM_TRAINER_KIND_H
#define SDM_TRAINER_KIND_H

#include "optimiser.h"
#include "trainer.h"

struct train_kind {
    /* Edge of the blocks the maps are stored in (dataset.h); 0: map order. */
    size_t (*block)(const sdm_config *c);
    /* Levels of blocks (sdm/pod.h); NULL: one. */
    size_t (*levels)(const sdm_config *c);
    /* The maps before training are there: sizes, start of the weights. */
    sdm_status (*begin)(trainer *t, sdm_error *err);
    /* Random maps have come into `slots`; NULL when nothing follows from that. */
    sdm_status (*take)(trainer *t, const size_t *slots, size_t n, sdm_error *err);
    /* The root mean square error (mm) of maps in slots[n] as the network is in the fit; only for
     * kinds with data.sampling (config.h). */
    sdm_status (*errors)(const trainer *t, const size_t *slots, size_t n, double *error,
                         sdm_error *err);
    /* Trains from t->phase to the end. resumed: at the checkpoint, whose weights
     * checkpoint_weights() gives. */
    sdm_status (*run)(trainer *t, bool resumed, sdm_error *err);
    /* The weights that the current phase trains. */
    parameters *(*weights)(trainer *t);
    /* Of what the weights depend on beside the config. */
    uint64_t (*fingerprint)(const trainer *t);
    /* The model file of the averaged weights, in memory (sdm_free()). */
    sdm_status (*build)(const trainer *t, const sdm_model_info *info, uint8_t **bytes, size_t *size,
                        sdm_error *err);
    void (*dispose)(trainer *t);
};

extern const train_kind pod_train, direct_train;

/* The maps of one step: slots[n] of t->data, in map order [nz][ny][nx] (dataset_map()). */
typedef struct direct_batch {
    size_t n;
    const size_t *slots;
    uint64_t step; /* counts the steps of the run: for random numbers */
} direct_batch;

typedef struct direct_network {
    /* Reads the config and the data, allocates what a step needs; *n_weights: their number. */
    sdm_status (*create)(const trainer *t, void **network, size_t *n_weights, sdm_error *err);
    void (*dispose)(void *network); /* NULL does nothing */
    /* Random start w[n_weights], counter-based (STREAM_INIT). */
    void (*init)(const trainer *t, const void *network, float *w);
    /* gradient[n_weights] of the loss at w, overwritten; *mse: mean square error of the batch,
       mm^2, whatever the loss (loss.h). Threads: trainer_threads(t); the same bits for any number.
     */
    sdm_status (*gradient)(const trainer *t, void *network, const float *w, const direct_batch *b,
                           float *gradient, double *mse, sdm_error *err);
    /* Mean square error on the held-out shapes (mm^2), of all voxels or of a fixed sample of them.
     */
    sdm_status (*evaluate)(const trainer *t, void *network, const float *w, double *mse,
                           sdm_error *err);
    sdm_status (*build)(const trainer *t, const void *network, const float *w,
                        const sdm_model_info *info, uint8_t **bytes, size_t *size, sdm_error *err);
} direct_network;

extern const direct_network point_direct; /* deepsdf and imnet */
extern const direct_network sdmnn_direct;

#endif
