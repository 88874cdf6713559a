/* Phantoms: the test images of an experiment. */
#pragma once

#include "experiment_command.h"
#include "sdm/pose.h"

/* A test image with its truth and the start of a fit. Zero-initialise;
 * cli_experiment_phantom_dispose() frees. */
typedef struct cli_experiment_phantom {
    double truth[SDM_MAX_PARAMS], start[SDM_MAX_PARAMS]; /* parameters */
    sdm_pose pose, start_pose;                           /* true pose, start pose */
    sdm_grid grid;
    double contrast; /* inside mean less outside mean, HU */
    float *values;   /* [nz][ny][nx] HU; labels: 1 inside, 0 outside */
    uint8_t *label;  /* [nz][ny][nx] 1 inside, 0 outside */
} cli_experiment_phantom;

/* Makes phantom `index` of the experiment for a method: the shape of `job` as the method shows it
 * (its keys noise, blur, contrast, wrong, labels). It is the same for all methods whose shapes have
 * the same ranges. SDM_E_ARG: fit.voxel is too small. */
sdm_status cli_experiment_phantom_make(const cli_experiment_run *run, const cli_experiment_job *job,
                                       const sdm_experiment_method *method, size_t index,
                                       cli_experiment_phantom *out, sdm_error *err);
void cli_experiment_phantom_dispose(cli_experiment_phantom *p);
