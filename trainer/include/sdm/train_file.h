/* Trains a network from a configuration file, as `sdmgen train` does. The functions are in a
 * library of their own, which needs libyaml and, for pictures, cairo. */
#ifndef SDM_TRAIN_FILE_H
#define SDM_TRAIN_FILE_H

#include <stdbool.h>

#include "sdm/model.h"
#include "sdm/registry.h"

#ifdef __cplusplus
extern "C" {
#endif

/* State of a run. */
typedef struct sdm_training_progress {
    const char *phase; /* "trial", "data", "bases", "fit", "refine" or "evaluate" */
    double fraction;   /* used fraction of the whole budget, 0 .. 1 */
    int64_t step;      /* optimiser steps so far */
    int64_t maps;      /* exact training maps so far */
    double loss_mm2;   /* mean square error of the last batch; NaN before the first step */
    /* root mean square error on held-out shapes; NaN before the first evaluation */
    double heldout_rmse_mm;
    double seconds, seconds_left; /* of the run; NaN: not known */
} sdm_training_progress;

/* Initialise with zeros. Later versions add members at the end only. */
typedef struct sdm_training_opts {
    /* [n_settings] "key=value" in place of keys of the file, as on the command line:
     * "network.depth=4", "shape.ranges.a=[2,3]" */
    const char *const *settings;
    size_t n_settings;
    /* folder of the run; NULL: output.folder of the configuration. If it holds a model or a
     * checkpoint, `resume` or `force` must be set */
    const char *folder;
    bool resume; /* continue from the checkpoint in the folder */
    bool force;  /* start again; the files of the older run are replaced as soon as the new run has
                    passed all its checks */
    /* Called in the thread that called the library, about 10 times a second at most. May be NULL.
     */
    void (*progress)(void *user, const sdm_training_progress *p);
    /* Called by any thread. true: the run writes a checkpoint and ends with SDM_E_CANCELLED. May be
     * NULL. */
    bool (*cancelled)(void *user);
    /* Called with each notice of the training, a text of one line without line feed, in the thread
     * that called the library. May be NULL. */
    void (*message)(void *user, const char *line);
    void *user; /* first argument of progress, cancelled and message */
} sdm_training_opts;

/* Result of a run. */
typedef struct sdm_training_result {
    char model_path[1024];
    sdm_accuracy accuracy; /* on the held-out shapes */
    int64_t steps, maps;   /* optimiser steps; exact training maps */
    double seconds;
    const char *grade;  /* "good", "usable" or "poor"; a constant string */
    char sentence[512]; /* what limits the model and what to do; "": nothing that was measured */
} sdm_training_result;

/* Reads the configuration `path`, creates its shape from the registry (built-in shapes, plug-ins or
 * the caller's own) and trains. The folder of the run then holds model.sdm and the other files of
 * docs/formats.md. Relative paths in the options of the shape start from the folder of the file.
 * opts and result may be NULL. SDM_E_CONFIG with one line "file:line:column: ..." for each mistake;
 * SDM_E_ARG (the folder), SDM_E_IO, SDM_E_NOMEM, SDM_E_PLUGIN, SDM_E_CANCELLED; SDM_E_QUALITY: the
 * network gives numbers that are not finite. [any thread; one run at a time in a folder] */
SDM_API sdm_status sdm_training_run(const char *path, const sdm_registry *registry,
                                    const sdm_training_opts *opts, sdm_training_result *result,
                                    sdm_error *err);

#ifdef __cplusplus
}
#endif
#endif
