/* How long a training takes on several nodes, how much memory it needs and how many bytes it sends,
   from the speed of this machine. docs/plan.md has the model. */
#pragma once

#include "sdm/internal/train.h"

#ifdef __cplusplus
extern "C" {
#endif

/* A stage of a training. The order is that of the run. */
typedef enum sdm_plan_stage {
    SDM_PLAN_TRIALS = 0, /* of network.kind: auto, else nothing */
    SDM_PLAN_DESIGN,     /* before any map: of a template, else nothing */
    SDM_PLAN_MAPS,
    SDM_PLAN_BASES, /* local bases and projections of the maps */
    SDM_PLAN_MODES, /* global modes: nodes share the products, not the rest */
    SDM_PLAN_FIT,
    SDM_PLAN_REFINE,
    SDM_PLAN_STAGES
} sdm_plan_stage;

/* "trials", "design", "maps", "bases", "modes", "fit" or "refine". */
const char *sdm_plan_stage_name(sdm_plan_stage stage);

/* The work of a training. Times are core seconds: wall time on one core, or on n cores n times as
   much. Numbers of values are those of floats unless stated. */
typedef struct sdm_train_work {
    sdm_network_kind kind;    /* auto is planned as pod */
    bool only_pod;            /* auto: the shape does not allow a template */
    double n_holdout, n_maps; /* held-out maps; all others, online ones included */
    double n_pool;            /* maps in memory at a time, but for the held-out ones */
    double n_params, n_voxels, n_map_voxels; /* n_voxels: of the maps that the network learns */
    double steps, refine_steps;
    double trials, trial_maps;    /* of network.kind: auto; exact maps made for them alone */
    double design;                /* of all that precedes the maps */
    double map;                   /* of one exact map */
    double bases;                 /* of all maps */
    double modes, modes_products; /* of all maps; the part of the products of matrices */
    double fit_step, refine_step; /* of one step */
    /* pod: coefficients of the highest level, latent variables, values of all bases, trees, modes,
       layers, width; rows of a batch, also of the refinement; functions kept of a lowest block. */
    double coefficients, latents, basis, trees, modes_kept, depth, width, batch, refine_batch, keep;
    double fit_weights, weights; /* trained in the fit, in the model */
    double weight_bytes;         /* of a weight of the decoder in the model file */
    bool shared;                 /* the steps are shared by nodes: pod and corrected templates */
    double measured_seconds;     /* that the measurement took */
    int threads;                 /* with which it was made */
} sdm_train_work;

/* Measures the work of a training on this machine, which takes a few seconds: exact maps, bases of
   few maps, steps of a small training; with network.kind: auto also the design of a template.
   Nothing is written. hooks: cancelled and user are used; may be NULL. The errors of a training. */
sdm_status sdm_train_measure(const sdm_config *config, const sdm_instance *shape,
                             const sdm_train_hooks *hooks, sdm_train_work *out, sdm_error *err);

typedef struct sdm_train_plan {
    double seconds[SDM_PLAN_STAGES], received[SDM_PLAN_STAGES]; /* bytes received by a node */
    double all_seconds, all_received;
    double memory;            /* bytes on each node */
    double model, checkpoint; /* bytes of the files; checkpoint: at most */
    double dataset;           /* bytes of all maps, if they are kept */
} sdm_train_plan;

/* Network between nodes that the plan assumes: bytes a second received by a node, and seconds that
   a message takes. */
#define SDM_PLAN_BANDWIDTH 1.25e9
#define SDM_PLAN_LATENCY 50e-6

/* Plans the work on `nodes` >= 1 with `cores` >= 1 each, one process a node. */
void sdm_train_plan_make(const sdm_train_work *work, int nodes, int cores, sdm_train_plan *out);

/* The largest power of two of nodes up to 1024 with which the last doubling makes the training at
   least 1.5 times as fast. */
int sdm_train_plan_pays(const sdm_train_work *work, int cores);

#ifdef __cplusplus
}
#endif
