/* Which points of the Sobol' sequence the random samples of a run are.

   Uniform: sample i is point i. Error-driven: the sequence is thinned so that online samples lie
   dense where the network errs. What the network's error was when it met a sample, before it
   trained on it, is the observation; a regression of it over the parameters (error_model.h) gives
   the error e at a point, and a point becomes a sample with the density

       floor + (1 - floor) min(e / mean of e, cap),   floor 1/2, cap 7,

   relative to the uniform one, so at least half of the samples of a region come in any case. The
   plan is a function of the observations alone, and it is made in rounds, one ahead of the samples:
   the same for any number of threads. */
#ifndef SDM_SAMPLE_PLAN_H
#define SDM_SAMPLE_PLAN_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/status.h"

/* samples of a round; at least this many behind the last observed one are always planned */
#define SAMPLE_ROUND 32

typedef struct sample_space {
    size_t n_params;
    const double *min, *max; /* [n_params] */
    uint64_t seed;
} sample_space;

typedef struct sample_plan {
    bool by_error;
    size_t n;         /* samples of the run */
    size_t n_planned; /* samples whose point is known; uniform: n */
    uint64_t *point;  /* [n], by_error only */
    float *error;     /* [n], by_error only: logarithm of the error over that of its round; NaN: not
                         observed */
} sample_plan;

sdm_status sample_plan_create(sample_plan *p, bool by_error, size_t n, sdm_error *err);
void sample_plan_dispose(sample_plan *p);

/* The first n_start samples, made before training, and the first two rounds are the first points.
 */
void sample_plan_start(sample_plan *p, size_t n_start);

/* The number of the point that sample `index` < n_planned is. */
uint64_t sample_plan_point(const sample_plan *p, size_t index);

/* The network's root mean square errors at samples first .. first + n - 1, of one round and not
 * trained on yet. */
void sample_plan_observe(sample_plan *p, size_t first, size_t n, const double *error);

/* n_taken samples are there, and what was observed of them is known: plans the rounds up to the one
 * behind that of sample n_taken. */
sdm_status sample_plan_extend(sample_plan *p, const sample_space *space, size_t n_start,
                              size_t n_taken, sdm_error *err);

#endif
