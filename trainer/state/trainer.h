/* The state of a training run that all kinds of networks share. The functions that differ between
 * kinds are called through `kind` (kind.h); a kind keeps its own data behind `state`. */
#pragma once

#include "data/dataset.h"
#include "data/producer.h"
#include "numerics/optimiser.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/train.h"
#include "turns.h"

typedef struct train_kind train_kind;

/* The speed of the work: units (computed maps, or steps) finished in the present phase at two times
   that lie two to four seconds apart, and the time of a unit since the first of them. */
typedef struct trainer_pace {
    int64_t done;      /* units finished in this phase */
    double unit_maps;  /* maps of a unit */
    int64_t before[2]; /* `done` at seconds[0] and seconds[1] */
    double seconds[2];
} trainer_pace;

typedef struct trainer {
    const sdm_config *config;
    const sdm_instance *shape;
    const char *folder;    /* NULL: a trial, which writes no files */
    sdm_train_hooks hooks; /* but for rank 0 without functions */
    int n_threads;
    const training_turns *turns; /* of the run; NULL: a trial */
    const train_kind *kind;
    void *design; /* data of the kind from before the maps; NULL before train_kind.prepare() */
    void *state;  /* data of the kind; NULL before train_kind.begin() */

    /* Blocks of all levels (sdm/internal/pod.h). Maps are stored in the order of the blocks of the
       lowest level; a single block means map order. */
    sdm_pod_levels levels;
    sdm_pod_block *blocks;
    dataset data;
    dataset tried;      /* maps of the race of kinds (race.h); empty: none */
    producer *producer; /* NULL: no online sample is left to make */

    /* CRC-64 of the shape's data files, by option; 0: the option names no file. */
    uint64_t file_sums[SDM_MAX_OPTIONS];

    sdm_phase phase;
    int64_t step, phase_step; /* optimiser steps of the run; of this phase */
    double design_until;      /* sdm_clock() at which the design of a template is given up with
                                 SDM_E_CANCELLED; 0: no limit */
    double started;           /* sdm_clock() at the start, minus the time used before a resume, s */
    /* Seconds since `started`. */
    double phase_started, last_report, last_checkpoint, last_evaluation;
    double evaluation_seconds; /* duration of the last evaluation */
    int64_t evaluated_step;    /* step of the last evaluation; -1: none yet */
    trainer_pace pace;
    double loss, heldout_mse;  /* mm^2 */
    struct sdm_text *metrics;  /* all lines of metrics.jsonl */
    double prepared_seconds;   /* trainer_seconds() before the first step */
    double saved_seconds;      /* by train.patience */
    double map_seconds;        /* s a map while the maps before the first step were made */
    double begin_seconds;      /* s, of train_kind.begin() */
    bool overrun_told;         /* that the maps will not fit into the budget of time */
    bool pace_told;            /* how many maps fit into it */
    sdm_accuracy accuracy;     /* accuracy of the finished model */
    sdm_model_quality quality; /* the verdict on it, for its file */
} trainer;
