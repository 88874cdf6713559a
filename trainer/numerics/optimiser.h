/* The Adam optimiser (Kingma and Ba 2015), the running average of weights and the schedule of the
   learning rate. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

/* n weights w with Adam's first and second moments m and v, the running average of w, and the best
   average of a phase (state/best.h). */
typedef struct parameters {
    size_t n;
    float *w, *m, *v, *average, *best;
    double best_mse, gain_mse; /* smallest held-out error; the last one that counted as a gain */
    double gain_at;            /* fraction of the phase's budget at which it was found */
} parameters;

/* Allocates all arrays, filled with 0; the errors are infinite. Call trainer_parameters_dispose()
 * also after an error. */
sdm_status trainer_parameters_create(parameters *p, size_t n, sdm_error *err);
void trainer_parameters_dispose(parameters *p);

/* Learning rate, decay of the second moments and bias corrections of one Adam step. */
typedef struct adam_step {
    float rate, decay_v, correct_m, correct_v;
} adam_step;

/* The usual decay of the second moments (beta_2). */
#define ADAM_DECAY 0.999

/* Constants of Adam's step t = 1, 2, ... with learning rate `rate` and the given decay of the
   second moments; the first moments decay by 0.9. */
adam_step trainer_adam_begin(double rate, double decay, int64_t t);

/* Updates weights first .. first + n - 1 and their moments from the gradient g[n], with the
   learning rate multiplied by `scale`. One thread. */
void trainer_adam_update(parameters *p, size_t first, size_t n, const float *g, adam_step step,
                         float scale);

/* Updates all weights from the gradient g[n]. Threads are those of the caller's team
   (sdm/internal/team.h), here and below; the bits do not depend on their number. */
void trainer_adam_update_all(parameters *p, const float *g, adam_step step, int n_threads);

/* average += (1 - decay) * (w - average) for all weights. */
void trainer_average_update(parameters *p, double decay, int n_threads);

/* Lets the average follow the weights after step number `step` = 1, 2, ... of a phase, with the
   decay per step; 0: the average is a copy of the weights. Most calls do nothing: the average
   moves after every eighth step and after the last one. */
void trainer_average_follow(parameters *p, double decay, int64_t step, bool last, int n_threads);

/* Factor of the learning rate at `fraction` (0 .. 1) of a phase: rises linearly from 0 to 1 up to
   `warmup`, then falls to 0 along half a cosine. */
double trainer_rate_schedule(double fraction, double warmup);
