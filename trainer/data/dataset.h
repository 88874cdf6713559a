/* The exact maps a network is trained on: a static grid over the parameters, and random shapes in a
   replay pool that worker threads fill while training goes on. Which sample is in which slot after
   n samples depends on n alone. */
#ifndef SDM_DATASET_H
#define SDM_DATASET_H

#include "sample_plan.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/train.h"

/* Maps are kept in block order (sdm/pod.h) as 16-bit integers with a scale for each map: 150,000
   voxels take 300 kB, and the rounding, at most 1/65534 of the largest distance, adds about 2e-8
   mm^2 to the mean square error of a 7 mm map. */
typedef struct dataset {
    const sdm_instance *shape;
    const sdm_grid *grid;
    const sdm_pod_block *blocks;
    size_t n_blocks, n_voxels, n_params;
    double min[SDM_POD_MAX_PARAMS], max[SDM_POD_MAX_PARAMS];
    uint64_t seed;
    size_t counts[SDM_POD_MAX_PARAMS]; /* points of the static grid along each parameter */
    size_t n_static, n_start,
        n_online;     /* samples: static; random before training; random during it */
    size_t n_ring;    /* slots for random maps; they replace the oldest when there are more samples
                         than slots */
    size_t n_slots;   /* n_static + n_ring */
    size_t n_taken;   /* random samples taken into the pool so far */
    sample_plan plan; /* which point of the Sobol' sequence each random sample is */
    double *params;   /* [n_slots][P] */
    int16_t *maps;    /* [n_slots][n_voxels] */
    float *scale;     /* [n_slots] mm per unit */
    size_t n_holdout;
    double *holdout_params; /* [n_holdout][P] */
    float *holdout;         /* [n_holdout][n_voxels], block order, mm */
} dataset;

/* Fills the sizes and allocates; grid, blocks, shape, ranges and seed are set by the caller.
   SDM_E_CONFIG when the pool cannot hold the static grid and the start within the budget. */
sdm_status dataset_create(dataset *d, const sdm_config *config, sdm_error *err);
void dataset_dispose(dataset *d);

/* What is asked of the caller while maps are made; every function may be NULL. */
typedef struct fill_hooks {
    void (*report)(void *user, size_t done, size_t all); /* on the calling thread */
    bool (*cancelled)(void *user);
    bool (*enough)(void *user); /* true: the rest of the start is left to be made during training
                                   (n_start and n_online change) */
    void *user;
} fill_hooks;

/* Makes all maps that are needed before training: held-out, static, start. */
sdm_status dataset_fill(dataset *d, int n_threads, const fill_hooks *hooks, sdm_error *err);

/* The space that plan and random samples are of; it points into d. */
sample_space dataset_space(const dataset *d);

/* Number of slots that hold a random map. */
size_t dataset_random_slots(const dataset *d);

/* Slot of random sample `index`. */
size_t dataset_slot(const dataset *d, size_t index);

/* Slot in row `i` of the batch of `step`: counter-based in `stream`; the first `share` of the rows
 * from the static grid. */
size_t dataset_draw(const dataset *d, uint64_t stream, double share, size_t batch, uint64_t step,
                    size_t i);

/* map[n_voxels] of a slot, mm, block order. */
void dataset_map(const dataset *d, size_t slot, float *map);

/* Threads that make random samples from `first` on, in order, while the caller trains: those that
   are planned, and more as the caller allows. */
typedef struct producer producer;
sdm_status producer_start(dataset *d, size_t first, int n_threads, producer **out, sdm_error *err);

/* Samples below n_planned may be made: their points are in d->plan. */
void producer_allow(producer *p, size_t n_planned);

/* Number of finished samples that wait to be taken, without a gap. */
size_t producer_ready(producer *p);

/* Takes finished samples into the pool until it holds `until` of them, waiting for those that are
 * not ready. */
sdm_status producer_take(producer *p, size_t until, sdm_error *err);

void producer_stop(producer *p);

#endif
