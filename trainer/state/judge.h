/* What a run says at its end about its model (sdm/internal/verdict.h). */
#pragma once

#include "derivative_check.h"
#include "kind.h"
#include "sdm/internal/verdict.h"
#include "volume_check.h"

/* Errors of the finished model that sdm_accuracy does not have. */
typedef struct model_errors {
    double rmse_voxel_mm; /* root mean square error of the voxels within a voxel of the surface */
    double dice;          /* Dice coefficient: mean over the held-out shapes */
    double dice_min;      /* Dice coefficient: smallest of a held-out shape */
    /* root mean square errors of the voxels farther from the surface than sdm_accuracy.near_mm,
       inside and outside; NaN: there are none */
    double rmse_inside_mm, rmse_outside_mm;
    double far_mm2;        /* what these voxels add to the mean square error of all voxels */
    double largest_at_mm;  /* exact signed distance at the voxel with the largest error */
    double far_largest_mm; /* largest error of the voxels farther than near_mm; NaN: none */
    derivative_check derivatives;
    volume_check volumes;
} model_errors;

/* Measures the parts of the error and fills *out. t->accuracy must be set. */
sdm_status trainer_verdict_make(trainer *t, const model_errors *errors, sdm_verdict *out,
                                sdm_error *err);

/* The measured figures from which the verdict follows. */
typedef struct verdict_input {
    const sdm_config *config;
    double maps;  /* training maps made by the run */
    double fixed; /* those of them on the static grid */
    double n_params;
    bool cut;             /* the time of the budget ended before all maps of data.start were made */
    bool full;            /* data.memory_gb did not hold all of them */
    bool ended_early;     /* by train.patience */
    double steps;         /* of the optimiser */
    double minutes_asked; /* trainer_minutes_asked() */
    double budget; /* of the run, in the unit of the key that gives it; with `auto` this training
                      may have had a part of it */
} verdict_input;

/* Sets grade, limit, key, values and sentence from the figures in *v. */
void trainer_verdict_decide(const verdict_input *in, sdm_verdict *v);

/* The sentence becomes that of a run that had no time to train `other`, too, after `own`: what
   limits its model says nothing about whether the other kind is better. tried: `other` had a trial.
 */
void trainer_verdict_unfinished(const char *own, const char *other, bool tried, sdm_verdict *v);
