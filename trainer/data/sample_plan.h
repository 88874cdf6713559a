/* The sample plan: it assigns each random training map a point of the Sobol' sequence as its
   parameters.

   Uniform: sample i is point i. Error-driven (data.sampling: error): the sequence is thinned so
   that the samples made during training ("online") lie more densely where the network's error is
   large. The error is observed on each new map before the network trains on it. A regression over
   the parameters (error_model.h) gives the error e at any point, and a point becomes a sample with
   probability proportional to

       floor + (1 - floor) min(e / mean of e, cap),   floor = 1/2, cap = 7,

   so every region keeps at least half of the density of the Sobol' points. The plan depends on the
   observations only, and it is made in rounds, one round ahead of the samples. It is therefore the
   same for any number of threads. */
#pragma once

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "sdm/shape.h"
#include "sdm/status.h"

/* Number of samples in a round. At least this many samples beyond the last observed one are always
 * planned. */
#define SAMPLE_ROUND 32

/* The distributions of the parameters of the samples, and the seed. */
typedef struct sample_space {
    size_t n_params;
    const double *min, *max;              /* [n_params] */
    const sdm_distribution *distribution; /* [n_params] */
    uint64_t seed;
} sample_space;

typedef struct sample_plan {
    bool by_error;
    size_t n;         /* number of samples in the run */
    size_t n_planned; /* samples with a fixed point; uniform: n */
    uint64_t *point;  /* [n], error-driven only */
    /* [n], error-driven only: logarithm of (error / geometric mean error of its round); NaN: not
       observed. */
    float *error;
} sample_plan;

sdm_status trainer_sample_plan_create(sample_plan *p, bool by_error, size_t n, sdm_error *err);
void trainer_sample_plan_dispose(sample_plan *p);

/* Assigns the first points of the sequence to the n_start samples made before training and to the
   first two rounds of online samples. */
void trainer_sample_plan_start(sample_plan *p, size_t n_start);

/* Number of the Sobol' point of sample `index` < n_planned. */
uint64_t trainer_sample_plan_point(const sample_plan *p, size_t index);

/* Records error[n], the network's root mean square errors (mm) on samples first .. first + n - 1,
   which must be one round and not trained on yet. */
void trainer_sample_plan_observe(sample_plan *p, size_t first, size_t n, const double *error);

/* Call when n_taken samples are in the pool and their observed errors are recorded: plans all
   rounds up to and including the round after the one of sample n_taken, the next sample to be
   taken. n_start: number of samples made before training. */
sdm_status trainer_sample_plan_extend(sample_plan *p, const sample_space *space, size_t n_start,
                                      size_t n_taken, sdm_error *err);
