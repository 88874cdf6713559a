/* Training: takes a configuration and a shape, writes a model file and the other files of a run. */
#pragma once

#include "sdm/exact.h"
#include "sdm/internal/comm.h"
#include "sdm/internal/config.h"
#include "sdm/internal/map_store.h"
#include "sdm/internal/mistakes.h"
#include "sdm/internal/verdict.h"
#include "sdm/model.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Phases of a run, in order but for the last. Checkpoints store these numbers. */
typedef enum sdm_phase {
    /* Exact maps are computed. */
    SDM_PHASE_DATA = 0,
    /* `pod`: local bases and global modes are computed from the maps. */
    SDM_PHASE_BASES,
    /* `pod`: the MLP is fitted to the mode coefficients. Other kinds: the whole training. The name
     * of this phase in metrics.jsonl is "fit". */
    SDM_PHASE_MODE_FIT,
    /* `pod`: all weights are trained together on maps. */
    SDM_PHASE_REFINE,
    /* The errors of the finished model are measured on the held-out maps. */
    SDM_PHASE_EVALUATE,
    /* Before all others: the short trials of network.kind: auto. */
    SDM_PHASE_TRIAL
} sdm_phase;

/* State of a run, passed to the progress callback. */
typedef struct sdm_progress {
    sdm_phase phase;
    double fraction; /* used fraction of the whole budget, 0 .. 1 */
    /* Optimiser steps; exact training maps computed so far. */
    int64_t step, samples;
    int64_t samples_at_start; /* exact training maps that precede the first step */
    /* Mean square error of the last batch, mm^2, whatever train.loss; NaN before the first step. */
    double loss;
    /* Root mean square error on held-out shapes, and the value of `seconds` when it was measured;
       NaN before the first evaluation. */
    double heldout_rmse_mm, heldout_seconds;
    /* Maps per second over the last two to four seconds: in SDM_PHASE_DATA computed maps, later
       maps used for training; NaN: not known yet. */
    double samples_per_second;
    double seconds, seconds_left; /* of the run; NaN: not known */
} sdm_progress;

/* Callbacks and maps of the caller; each may be NULL. */
typedef struct sdm_train_hooks {
    /* Called by the training thread about 10 times a second at most. */
    void (*progress)(void *user, const sdm_progress *p);
    /* Called by any thread. true: the run writes a checkpoint and ends with SDM_E_CANCELLED. */
    bool (*cancelled)(void *user);
    /* Called by the training thread with a notice of one line. */
    void (*message)(void *user, const char *line);
    /* The same with a warning: the result is probably not what the user wants. NULL: message. */
    void (*warning)(void *user, const char *line);
    void *user;
    /* Maps that need not be made, of this configuration; NULL: none. The result has the same bits.
     */
    const sdm_map_store *store;
    /* The processes that share the work; all call sdm_train() with the same arguments, and rank 0
       alone calls the functions above and writes files. NULL: this process is alone. */
    sdm_comm *comm;
} sdm_train_hooks;

typedef struct sdm_train_report {
    char model_path[SDM_PATH_TEXT_MAX];
    sdm_accuracy accuracy;
    /* Optimiser steps; training maps. */
    int64_t steps, samples;
    double seconds;
    sdm_verdict verdict;
    sdm_network_kind kind; /* of the model */
    bool chosen;           /* by network.kind: auto */
    double map_ms; /* processor time of one map; NaN: not measured, as only one kind was trained */
    /* network.kind: auto has trained another kind, too, which was worse; its accuracy, its root
       mean square error of the voxels within a voxel of the surface, its map_ms, the error of its
       derivatives as sdm_verdict.derivative_error has it (NaN: not measured), its grade and its
       model file, model-KIND.sdm beside model_path; "": it could not be written. */
    bool compared;
    sdm_network_kind other_kind;
    sdm_accuracy other;
    double other_voxel_mm, other_ms, other_derivative;
    sdm_grade other_grade;
    char other_path[SDM_PATH_TEXT_MAX];
    /* It has only tried another kind, in a short trial: other_kind, other.rmse_mm, other_voxel_mm
       and other_ms are of this. */
    bool tried;
    /* The other kind was to be trained, too, but hardly any of the budget was left. */
    bool unfinished;
    /* train.minutes that hold the maps which the parameters ask of a training of `pod`, at the
       pace of this run; 0: it had them, or the budget is no time. */
    double pod_minutes;
    /* train.minutes of which a fifth holds the trials of both kinds, where network.kind: auto left
       the other kind without a trial and a training, because train.minutes was too short; 0: else.
     */
    double trial_minutes;
    /* About the time of a training with network.kind: template on the same grid, s, where
       network.kind: auto left out its trial and it most likely needs no training; 0: else. */
    double template_seconds;
} sdm_train_report;

/* Trains a network as `config` says and writes into `folder`: config.yaml (with all defaults filled
   in), metrics.jsonl, checkpoint.sdmc (removed at the end of the run), model.sdm, loss.png.
   network.kind: auto may train two kinds, one after the other: model.sdm is first that of the
   first, at the end that of the better one, and so are config.yaml and loss.png; model-pod.sdm or
   model-template.sdm is the other one. resume: continues
   from the checkpoint in `folder`; SDM_E_CONFIG if the checkpoint's configuration differs in more
   than budget and output. hooks and report may be NULL. SDM_E_UNSUPPORTED: the ranks
   differ in program, configuration or processor. */
sdm_status sdm_train(const sdm_config *config, const sdm_instance *shape, const char *folder,
                     bool resume, const sdm_train_hooks *hooks, sdm_train_report *report,
                     sdm_error *err);

/* Refuses a folder with a model or a checkpoint, unless `resume` (there must be a checkpoint then)
   or `force` is set. SDM_E_ARG. */
sdm_status sdm_train_check_folder(const char *folder, bool resume, bool force, sdm_error *err);

/* *out = the configured shape with its options, to be freed with sdm_instance_free(); `shape` is
   the one of the configured name. Relative paths start from the folder of the configuration; in *c
   they become absolute, so that a copy of the configuration elsewhere names the same files.
   SDM_E_CONFIG with a line "file:line:column: ..." for each mistake in options, ranges and
   distributions. */
sdm_status sdm_train_shape(sdm_config *c, const sdm_shape *shape, sdm_instance **out,
                           sdm_error *err);

/* Parameter ranges of the training, min[n] and max[n]: those of the shape, narrowed by the
   configuration. SDM_E_CONFIG with a line "file:line:column: ..." for every parameter that is
   unknown or whose range is wider than the shape's. */
sdm_status sdm_train_ranges(const sdm_config *config, const sdm_instance *shape, double *min,
                            double *max, sdm_error *err);

/* Completes a configuration by the shape. data.static: auto becomes the number for its parameters.
   A grid that is to be fitted to the shapes (grid: auto, grid.voxels, or grid.spacing alone)
   becomes sdm_grid_around() the box of sdm_shape_box() over the ranges of sdm_train_ranges(), with
   `grid: auto` finer if the thinnest part has less than three voxels across it (beyond 96 voxels
   along the longest edge: less than two; at most 400,000 in all, and up to a million where the
   thinnest part of the shapes that `shapes check` looks at would be missing: sdm_too_thin()), moved
   by
   sdm_grid_avoid_faces(); and one line about it is appended to *line (which may be NULL). The same
   configuration and shape give the same result. SDM_E_CONFIG with file:line:column, and the errors
   of sdm_instance_mesh(). */
sdm_status sdm_train_complete(sdm_config *config, const sdm_instance *shape, sdm_text *line,
                              sdm_error *err);

/* Appends a grid that holds the shapes of the configuration, for a message about one that cuts
   them: "grid: {spacing: 0.2} (size: [66, 58, 41], spacing: 0.2, origin: [-6.1, -5.5, -2.1])" with
   the spacing of the present grid, or where that makes over 2.5 million voxels "grid: auto (...)"
   and why. Errors as sdm_train_complete(). */
sdm_status sdm_train_grid_proposal(const sdm_config *config, const sdm_instance *shape,
                                   sdm_text *out, sdm_error *err);

/* Do the maps that a training on this grid keeps from its start on (data.static, data.start and,
   twice as large, data.holdout) fit into data.memory_gb? A template without a correction keeps
   fewer. */
bool sdm_train_fits_memory(const sdm_config *c, size_t n_params, const sdm_grid *g);

/* Appends the price of the box of the grid with another spacing, mm: " (about 1.2 million voxels, 8
   times as many, which take as many times longer; maps of up to 7.1 GB in memory)", and whether
   data.memory_gb must be raised for it. */
void sdm_train_add_price(const sdm_config *c, size_t n_params, const sdm_grid *g, double spacing,
                         sdm_text *out);

/* SDM_E_CONFIG, and how much memory is needed, if they do not fit even with 512 maps in place of a
   larger data.start: a training makes as many of data.start before its first step as fit. */
sdm_status sdm_train_check_memory(const sdm_config *c, size_t n_params, const sdm_grid *g,
                                  sdm_error *err);

/* Distributions of the parameters in the training, out[n], on the ranges min[n] and max[n] of
   sdm_train_ranges(): as shape.distribution says. A normal distribution for which neither the
   configuration nor the shape has figures gets the default value (moved into the range) as its mean
   and a quarter of the range as its deviation. SDM_E_CONFIG with a line
   "file:line:column: ..." for every parameter that is unknown or whose figures do not fit its
   range. */
sdm_status sdm_train_distributions(const sdm_config *config, const sdm_instance *shape,
                                   const double *min, const double *max, sdm_distribution *out,
                                   sdm_error *err);

/* Adds to *m the mistakes in the ranges and distributions of the configuration, as the two
   functions above find them, and a shape with more than SDM_MAX_PARAMS parameters. */
void sdm_train_find_mistakes(const sdm_config *config, const sdm_instance *shape, sdm_mistakes *m);

#ifdef __cplusplus
}
#endif
