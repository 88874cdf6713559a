/* The pool of exact maps: its sizes, its memory, and the choice of slots. */
#include "dataset.h"

#include <math.h>
#include <string.h>

#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/sampling.h"
#include "sdm/internal/text.h"
#include "streams.h"

sdm_status trainer_dataset_static(dataset *d, const sdm_config *config, sdm_error *err)
{
    const size_t given = config->data.n_static_counts;
    if (given > 1 && given != d->n_params)
        return sdm_fail(err, SDM_E_CONFIG,
                        "%s: data.static has %zu counts, the shape has %zu parameters: give one "
                        "number or %zu",
                        config->file, given, d->n_params, d->n_params);
    d->n_static = sdm_config_static_count(config, d->n_params, 0) > 0;
    for (size_t i = 0; i < d->n_params && d->n_static; i++) {
        d->counts[i] = (size_t)sdm_config_static_count(config, d->n_params, i);
        if (d->n_static > SIZE_MAX / 64 / d->counts[i])
            d->n_static = SIZE_MAX / 64;
        else
            d->n_static *= d->counts[i];
    }
    return SDM_OK;
}

/* The grid is regular for every distribution: it is there to cover the range, which random shapes
 * leave sparse at the ends. The points along a parameter include both ends of its range; a single
 * point is the middle. */
void trainer_dataset_static_params(const dataset *d, size_t k, double *p)
{
    for (size_t i = 0; i < d->n_params; i++) {
        const size_t n = d->counts[i], at = k % n;
        k /= n;
        p[i] = n == 1 ? 0.5 * (d->min[i] + d->max[i])
                      : d->min[i] + (d->max[i] - d->min[i]) * (double)at / (double)(n - 1);
        if (at + 1 == n && n > 1) p[i] = d->max[i];
    }
}

void trainer_dataset_holdout_params(const dataset *d, size_t k, double *p)
{
    sdm_sample_params(d->seed, STREAM_HOLDOUT, k, d->min, d->max, d->distribution, d->n_params, p);
}

void trainer_dataset_random_params(const dataset *d, uint64_t k, double *p)
{
    sdm_sample_params(d->seed, STREAM_TRAIN, k, d->min, d->max, d->distribution, d->n_params, p);
}

// Random maps with which a training begins at least, if data.start asks for more than fit into the
// memory.
#define FEWEST 512

/* Numbers of the maps that a training keeps from its start on. */
typedef struct kept_maps {
    double fixed, start, holdout; // of the static grid, random, held out (twice as large)
} kept_maps;

static double kept_gb(kept_maps n, double n_voxels)
{
    return 2e-9 * (n.fixed + n.start + 2 * n.holdout) * n_voxels;
}

/* Does the memory hold the static grid, the held-out maps and the fewest random maps? */
static bool holds_fewest(const sdm_config *c, kept_maps n, size_t n_voxels)
{
    n.start = fmin(n.start, FEWEST);
    return kept_gb(n, (double)n_voxels) <= c->data.memory_gb;
}

static sdm_status refuse_memory(const sdm_config *c, kept_maps n, size_t n_voxels, sdm_error *err)
{
    const double gb = kept_gb(n, (double)n_voxels);
    return sdm_fail(
        err, SDM_E_CONFIG,
        "%s: data.static (%.0f maps), data.start (%.0f) and data.holdout (%.0f) on %.3g voxels "
        "need %.*f GB, data.memory_gb is %g: raise it, or make fewer maps or a coarser grid",
        c->file, n.fixed, n.start, n.holdout, (double)n_voxels, gb < 1 ? 4 : 1, gb,
        c->data.memory_gb);
}

static kept_maps maps_of(const sdm_config *c, size_t n_params)
{
    kept_maps n = {1, (double)c->data.start, (double)c->data.holdout};
    for (size_t i = 0; i < n_params; i++)
        n.fixed *= (double)sdm_config_static_count(c, n_params, i);
    return n;
}

bool sdm_train_fits_memory(const sdm_config *c, size_t n_params, const sdm_grid *g)
{
    return kept_gb(maps_of(c, n_params), (double)sdm_grid_count(g)) <= c->data.memory_gb;
}

void sdm_train_add_price(const sdm_config *c, size_t n_params, const sdm_grid *g, double spacing,
                         sdm_text *out)
{
    double times = 1;
    for (int a = 0; a < 3; a++) times *= g->spacing[a] / spacing;
    const double voxels = times * (double)sdm_grid_count(g),
                 gb = kept_gb(maps_of(c, n_params), voxels);
    sdm_text_add(
        out,
        " (about %.2g million voxels, %.2g times as many, which take as many times longer; "
        "maps of up to %.2g GB in memory",
        1e-6 * voxels, times, gb);
    if (gb > c->data.memory_gb)
        sdm_text_add(out, ": raise data.memory_gb, which is %g", c->data.memory_gb);
    sdm_text_add(out, ")");
}

sdm_status sdm_train_check_memory(const sdm_config *c, size_t n_params, const sdm_grid *g,
                                  sdm_error *err)
{
    const kept_maps n = maps_of(c, n_params);
    const size_t n_voxels = sdm_grid_count(g);
    return holds_fewest(c, n, n_voxels) ? SDM_OK : refuse_memory(c, n, n_voxels, err);
}

sdm_status trainer_dataset_size(dataset *d, const sdm_config *config, sdm_error *err)
{
    // the memory check refuses a static grid that is too large
    const sdm_status counted = trainer_dataset_static(d, config, err);
    if (counted) return counted;
    const double bytes = config->data.memory_gb * 1e9;
    d->n_start = (size_t)config->data.start;
    d->n_online = (size_t)config->data.online;
    d->n_holdout = (size_t)config->data.holdout;
    if (d->only_holdout) d->n_static = d->n_start = d->n_online = 0;

    // the memory holds the static grid and the held-out maps in any case (these as floats: two
    // units each), and as many random maps as fit into the rest; those of data.start that do not
    // fit are made during the training
    const double map_bytes = 2.0 * (double)d->n_voxels;
    const double room = bytes / map_bytes - (double)d->n_static - 2.0 * (double)d->n_holdout;
    const kept_maps n = {(double)d->n_static, (double)d->n_start, (double)d->n_holdout};
    if (!holds_fewest(config, n, d->n_voxels) || (room < 1 && !d->only_holdout))
        return refuse_memory(config, n, d->n_voxels, err);
    const size_t n_random = d->n_start + d->n_online;
    if (room < (double)d->n_start) d->n_start = (size_t)room;
    d->n_online = n_random - d->n_start;
    d->n_ring = room < (double)n_random ? (size_t)room : n_random;
    d->n_slots = d->n_static + d->n_ring;
    if (d->n_static + d->n_start == 0 && !d->only_holdout)
        return sdm_fail(err, SDM_E_CONFIG,
                        "%s: data.static and data.start give no map to start from", config->file);
    return SDM_OK;
}

sdm_status trainer_dataset_create(dataset *d, const sdm_config *config, sdm_error *err)
{
    const int rank = sdm_comm_rank(d->comm);
    d->first_kept = d->share ? d->share[rank] : 0;
    d->n_kept = d->share ? d->share[rank + 1] - d->first_kept : d->n_voxels;
    sdm_status s = SDM_ALLOC(&d->params, d->n_slots * d->n_params, "training parameters", err);
    size_t count = 0;
    if (!s) s = sdm_mul(d->n_slots, d->n_kept, &count, err);
    if (!s) s = sdm_alloc_unset((void **)&d->maps, count, sizeof *d->maps, "training maps", err);
    if (!s) s = SDM_ALLOC(&d->scale, d->n_slots, "training maps", err);
    if (!s)
        s = SDM_ALLOC(&d->holdout_params, d->n_holdout * d->n_params, "held-out parameters", err);
    if (!s) s = sdm_mul(d->n_holdout, d->n_voxels, &count, err);
    if (!s) s = SDM_ALLOC(&d->holdout, count, "held-out maps", err);
    if (!s)
        s = trainer_sample_plan_create(&d->plan, config->data.sampling == SDM_SAMPLING_ERROR,
                                       d->n_start + d->n_online, err);
    return s;
}

void trainer_dataset_dispose(dataset *d)
{
    sdm_free(d->share);
    sdm_free(d->params);
    sdm_free(d->maps);
    sdm_free(d->scale);
    sdm_free(d->holdout_params);
    sdm_free(d->holdout);
    trainer_sample_plan_dispose(&d->plan);
    *d = (dataset){0};
}

sample_space trainer_dataset_space(const dataset *d)
{
    return (sample_space){.n_params = d->n_params,
                          .min = d->min,
                          .max = d->max,
                          .distribution = d->distribution,
                          .seed = d->seed};
}

double trainer_dataset_voxel(const dataset *d)
{
    const double *spacing = d->grid->spacing;
    return fmin(fmin(spacing[0], spacing[1]), spacing[2]);
}

size_t trainer_dataset_slot(const dataset *d, size_t index)
{
    return d->n_static + index % d->n_ring;
}

sdm_status trainer_dataset_first_slots(size_t n, size_t **slots, sdm_error *err)
{
    const sdm_status s = SDM_ALLOC(slots, n, "numbers of maps", err);
    for (size_t i = 0; i < n && !s; i++) (*slots)[i] = i;
    return s;
}

size_t trainer_dataset_random_slots(const dataset *d)
{
    return d->n_taken < d->n_ring ? d->n_taken : d->n_ring;
}

size_t trainer_dataset_measured(const dataset *d)
{
    const size_t random = trainer_dataset_random_slots(d), n = random ? random : d->n_static;
    return n < d->n_holdout ? n : d->n_holdout;
}

size_t trainer_dataset_measured_slot(const dataset *d, size_t i)
{
    const size_t random = trainer_dataset_random_slots(d), n = random ? random : d->n_static;
    return (random ? d->n_static : 0) + i * n / trainer_dataset_measured(d);
}

size_t trainer_dataset_draw(const dataset *d, uint64_t stream, double share, size_t batch,
                            uint64_t step, size_t i)
{
    const size_t n_random = trainer_dataset_random_slots(d);
    bool from_grid = (double)i < share * (double)batch;
    if (!d->n_static) from_grid = false;
    if (!n_random) from_grid = true;
    const uint64_t counter = step * batch + i;
    if (from_grid) return (size_t)sdm_rng_below(d->seed, stream, counter, d->n_static);
    return d->n_static + (size_t)sdm_rng_below(d->seed, stream, counter, n_random);
}
