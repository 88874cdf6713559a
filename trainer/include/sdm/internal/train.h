/* Training: config and shape in, model file and run folder out. */
#ifndef SDM_TRAIN_H
#define SDM_TRAIN_H

#include "sdm/exact.h"
#include "sdm/internal/config.h"
#include "sdm/model.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum sdm_phase {
    SDM_PHASE_DATA = 0,
    SDM_PHASE_BASES,
    SDM_PHASE_FIT,
    SDM_PHASE_REFINE,
    SDM_PHASE_EVALUATE
} sdm_phase;

/* Where training stands; given to the progress callback. */
typedef struct sdm_progress {
    sdm_phase phase;
    double fraction;           /* of the whole budget, 0..1 */
    int64_t step, samples;     /* optimiser steps; exact maps made so far */
    double loss;               /* training loss, mm^2 (NaN when unknown) */
    double heldout_rmse_mm;    /* last evaluation (NaN before the first) */
    double samples_per_second; /* trained samples */
    double seconds, seconds_left;
} sdm_progress;

typedef struct sdm_train_hooks {
    void (*progress)(
        void *user,
        const sdm_progress *p); /* on the training thread, about 10 times a second; may be NULL */
    bool (*cancelled)(void *user); /* true: write a checkpoint, stop with SDM_E_CANCELLED; may be
                                      NULL; any thread */
    void (*message)(void *user,
                    const char *line); /* notices, one line; may be NULL; training thread */
    void *user;
} sdm_train_hooks;

typedef struct sdm_train_report {
    char model_path[SDM_PATH_TEXT_MAX];
    sdm_accuracy accuracy;
    int64_t steps, samples;
    double seconds;
} sdm_train_report;

/* Trains what the config says into `folder`: config.yaml (resolved), metrics.jsonl,
   checkpoint.sdmc, model.sdm, loss.png. resume: goes on from the checkpoint in `folder`
   (SDM_E_CONFIG when its config differs in more than the budget and output). */
sdm_status sdm_train(const sdm_config *config, const sdm_instance *shape, const char *folder,
                     bool resume, const sdm_train_hooks *hooks, sdm_train_report *report,
                     sdm_error *err);

/* Ranges the network is trained on: the shape's, narrowed by the config; min[n], max[n].
   SDM_E_CONFIG: an unknown parameter, or a range wider than the shape's, with file:line:column. */
sdm_status sdm_train_ranges(const sdm_config *config, const sdm_instance *shape, double *min,
                            double *max, sdm_error *err);

/* Parameters of random shape `index` of stream `stream` within [min, max]^n: Sobol' points (Joe and
   Kuo 2008) with a random digital shift up to 16 dimensions, counter-based uniform numbers beyond;
   p[n]. [any thread] */
void sdm_sample_params(uint64_t seed, uint64_t stream, uint64_t index, const double *min,
                       const double *max, size_t n, double *p);

#ifdef __cplusplus
}
#endif
#endif
