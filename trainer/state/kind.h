/* The interface of a kind of network to the trainer. There are three: trainer_kind_pod
   (pod/pod_kind.h), which computes bases first and trains their coefficients,
   trainer_kind_template (template/template_kind.h), which carries exact maps along, and
   trainer_kind_direct (direct/direct.h) for networks whose weights are all trained by gradient
   descent on the error of the maps. */
#pragma once

#include "trainer.h"

/* A mean square error (mm^2) on held-out maps, and on maps that the network is trained on. */
typedef struct error_pair {
    double heldout, training;
} error_pair;

/* Measured parts of the error of the averaged weights before rounding; NaN: not measured. */
typedef struct error_measures {
    error_pair network, bases; /* of the network; of its bases with the best coefficients */
    double modes;      /* held-out maps: what the bases hold and the global modes leave out */
    bool other_voxels; /* the voxels are only a sample of those of the maps */
    bool corrects;     /* the maps are those of a correction, not exact maps */
    double motion_mm, warp_mm; /* of a template (template_design) */
    double degree, ridge;      /* of the polynomials of the network or correction, as chosen */
} error_measures;

struct train_kind {
    /* A map takes long: ranks share those of the measurement of the model. */
    bool slow;
    /* Called before any map is made: may allocate t->design and set data.target or
       data.only_holdout. NULL: nothing to do. t->design may be that of another run of this kind,
       of the same shape, ranges, grid and seed: it is then taken over. */
    sdm_status (*prepare)(trainer *t, sdm_error *err);
    /* Edge of the blocks in which maps are stored (dataset.h), voxels; 0: map order. */
    size_t (*block)(const sdm_config *c);
    /* Number of levels of blocks (sdm/internal/pod.h); NULL: 1. */
    size_t (*levels)(const sdm_config *c);
    /* share[ranks + 1] = first voxel, in the order of t->blocks, whose values in training maps each
       rank needs; consecutive ranks have consecutive voxels. NULL: each rank needs whole maps. */
    void (*shares)(trainer *t, size_t *share);
    /* Called after the maps that precede training have been made: allocates t->state, designs the
       network, sets its initial weights. */
    sdm_status (*begin)(trainer *t, sdm_error *err);
    /* Called when new random maps have been put into slots[n]; NULL: nothing to do. */
    sdm_status (*samples_taken)(trainer *t, const size_t *slots, size_t n, sdm_error *err);
    /* error[n] = root mean square errors (mm) of the network on the maps in slots[n], in phase
       SDM_PHASE_MODE_FIT. Only for kinds that allow data.sampling (sdm/internal/config.h). */
    sdm_status (*errors)(const trainer *t, const size_t *slots, size_t n, double *error,
                         sdm_error *err);
    /* Trains from phase t->phase to the end. resumed: from the checkpoint; the kind allocates the
       weights of the phase and calls trainer_checkpoint_weights() to fill them. */
    sdm_status (*run)(trainer *t, bool resumed, sdm_error *err);
    /* Returns the weights that are trained in the current phase. */
    parameters *(*weights)(trainer *t);
    /* Gives all ranks the weights of the current phase, of which each may have only its part; NULL:
       each has all. */
    sdm_status (*gather)(trainer *t, sdm_error *err);
    /* Checksum of everything besides the configuration that the meaning of the weights depends on.
     */
    uint64_t (*fingerprint)(const trainer *t);
    /* *bytes = new model file with the averaged weights; free with sdm_free(). */
    sdm_status (*build)(const trainer *t, const sdm_model_info *info, uint8_t **bytes, size_t *size,
                        sdm_error *err);
    /* Sets the figures of *out that this kind has; all are NaN or false before. */
    sdm_status (*parts)(const trainer *t, error_measures *out, sdm_error *err);
    /* Frees t->state and t->design; NULL does nothing. */
    void (*dispose)(trainer *t);
};
