/* The exact maps that a network is trained and tested on: a static grid over the parameters, random
   shapes in a replay pool that worker threads refill during training (producer.h), and held-out
   random shapes for the evaluation. A "slot" is a place for one map in the pool. Which sample lies
   in which slot after n samples depends on n only. */
#pragma once

#include "sample_plan.h"
#include "sdm/internal/map_store.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/train.h"

/* The maps that a network learns, if they are not the exact maps: make() computes out[voxels of
   grid] from the exact map exact[nz][ny][nx] at p[n_params]. [any thread] */
typedef struct map_target {
    const sdm_grid *grid;
    sdm_status (*make)(const void *user, const double *p, const float *exact, float *out,
                       sdm_error *err); /* NULL: the network learns the exact maps */
    const void *user;
} map_target;

/* Maps are stored in block order (sdm/internal/pod.h) as 16-bit integers with one scale per map:
   150,000 voxels take 300 kB. The rounding error is at most 1/65534 of the largest distance, which
   adds about 2e-8 mm^2 to the mean square error of a 7 mm map. */
typedef struct dataset {
    sdm_comm *comm; /* the processes that share the work */
    const sdm_instance *shape;
    const sdm_grid *grid; /* of the exact maps */
    map_target target;
    bool only_holdout; /* no map is needed for the training */
    bool inside;       /* a voxel of a held-out map is inside the shape */
    /* Maps that need not be made again: those of another data set of the same shape, grid, target,
       blocks and seed; NULL: none. */
    const struct dataset *known;
    const sdm_map_store *store; /* exact maps that are in files already; NULL: none */
    const sdm_pod_block *blocks;
    size_t n_blocks, n_voxels, n_params; /* n_voxels: of the maps that the network learns */
    double min[SDM_POD_MAX_PARAMS], max[SDM_POD_MAX_PARAMS];
    sdm_distribution distribution[SDM_POD_MAX_PARAMS];
    uint64_t seed;
    size_t counts[SDM_POD_MAX_PARAMS]; /* points of the static grid along each parameter */
    /* Numbers of maps: static grid; random, made before training; random, made during training. */
    size_t n_static, n_start, n_online;
    /* Slots for random maps. With fewer slots than samples new maps replace the oldest ones. */
    size_t n_ring;
    size_t n_slots;   /* n_static + n_ring */
    size_t n_taken;   /* random samples put into the pool so far */
    sample_plan plan; /* Sobol' point of each random sample */
    /* First of the consecutive voxels that each rank keeps of every training map, [ranks + 1];
       NULL: each rank keeps all. first_kept, n_kept: those of this rank. */
    size_t *share;
    size_t first_kept, n_kept;
    double *params; /* [n_slots][P] */
    int16_t *maps;  /* [n_slots][n_kept] */
    float *scale;   /* [n_slots] mm per unit; 0: no map yet */
    size_t n_holdout;
    double *holdout_params; /* [n_holdout][P] */
    float *holdout;         /* [n_holdout][n_voxels], block order, mm */
} dataset;

/* Computes the numbers of maps from the configuration. n_params and n_voxels must be set. They do
   not depend on the number of ranks: data.memory_gb limits the maps of all ranks together.
   SDM_E_CONFIG: it is too small for the static grid, the held-out maps and the maps before
   training. */
sdm_status trainer_dataset_size(dataset *d, const sdm_config *config, sdm_error *err);

/* Allocates the arrays; after trainer_dataset_size(), and after `share` is set. Call
   trainer_dataset_dispose() also after an error. */
sdm_status trainer_dataset_create(dataset *d, const sdm_config *config, sdm_error *err);

/* Frees the arrays, `share` too. */
void trainer_dataset_dispose(dataset *d);

/* The values of the map in `slot` from `voxel` on, up to the last voxel that this rank keeps; it
   must keep `voxel`. */
static inline const int16_t *trainer_dataset_values(const dataset *d, size_t slot, size_t voxel)
{
    return d->maps + slot * d->n_kept + (voxel - d->first_kept);
}

/* Sets counts and n_static from the configuration; a product beyond SIZE_MAX / 64 is that.
   SDM_E_CONFIG: the number of counts does not fit n_params. */
sdm_status trainer_dataset_static(dataset *d, const sdm_config *config, sdm_error *err);

/* p[n_params] = parameters of held-out map k, of map k of the static grid, of random map k (point k
   of the sequence). They depend on k, the parameter space, the seed and counts alone. */
void trainer_dataset_holdout_params(const dataset *d, size_t k, double *p);
void trainer_dataset_static_params(const dataset *d, size_t k, double *p);
void trainer_dataset_random_params(const dataset *d, uint64_t k, double *p);

/* The parameter space of the random samples; its pointers refer to d. */
sample_space trainer_dataset_space(const dataset *d);

/* Smallest distance between neighbouring voxels of the exact maps, mm. */
double trainer_dataset_voxel(const dataset *d);

/* Number of slots that hold a random map. */
size_t trainer_dataset_random_slots(const dataset *d);

/* Slot of random sample `index`. */
size_t trainer_dataset_slot(const dataset *d, size_t index);

/* *slots = new array {0, 1, .. n - 1}; free with sdm_free(). */
sdm_status trainer_dataset_first_slots(size_t n, size_t **slots, sdm_error *err);

/* Number of maps of the pool on which errors are measured for comparison with those on the held-out
   maps, and the slot of the i-th: random maps, evenly spread, as many as there are held-out ones;
   without random maps, those of the static grid. */
size_t trainer_dataset_measured(const dataset *d);
size_t trainer_dataset_measured_slot(const dataset *d, size_t i);

/* Random slot for row i of the batch of `step`, from the counter-based numbers of `stream`. The
   first share * batch rows come from the static grid, the others from the random maps. */
size_t trainer_dataset_draw(const dataset *d, uint64_t stream, double share, size_t batch,
                            uint64_t step, size_t i);
