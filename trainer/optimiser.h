/* Adam (Kingma and Ba 2015) and the learning rate schedule. */
#ifndef SDM_OPTIMISER_H
#define SDM_OPTIMISER_H

#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

/* A set of weights with its moments and running average, in one allocation each. */
typedef struct parameters {
    size_t n;
    float *w, *m, *v, *average;
} parameters;

sdm_status parameters_create(parameters *p, size_t n, sdm_error *err);
void parameters_dispose(parameters *p);

/* The corrections of step t = 1, 2, ... */
typedef struct adam_step {
    float rate, correct_m, correct_v;
} adam_step;
adam_step adam_begin(double rate, int64_t t);

/* w -= scale * Adam update, for weights first .. first + n of p with gradient g[n]. One thread. */
void adam_update(parameters *p, size_t first, size_t n, const float *g, adam_step step,
                 float scale);

/* average += (1 - decay) (w - average) for all weights, in fixed slices. */
void average_update(parameters *p, double decay, int n_threads);

/* Factor of the learning rate at `fraction` (0..1) of the phase: linear warm-up, then half a cosine
 * down to zero. */
double schedule(double fraction, double warmup);

#endif
