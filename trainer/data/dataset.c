/* The pool of exact maps. */
#include "dataset.h"

#include <math.h>
#include <stdatomic.h>
#include <string.h>

#include "produce.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/threads.h"
#include "streams.h"

sdm_status dataset_create(dataset *d, const sdm_config *config, sdm_error *err)
{
    d->n_static = config->data.n_static_counts ? 1 : 0;
    const double bytes = config->data.memory_gb * 1e9;
    for (size_t i = 0; i < d->n_params && config->data.n_static_counts; i++) {
        const bool one_for_all = config->data.n_static_counts == 1;
        if (!one_for_all && config->data.n_static_counts != d->n_params)
            return sdm_fail(err, SDM_E_CONFIG,
                            "%s: data.static has %zu counts, the shape has %zu parameters: give "
                            "one number or %zu",
                            config->file, config->data.n_static_counts, d->n_params, d->n_params);
        d->counts[i] = (size_t)config->data.static_counts[one_for_all ? 0 : i];
        if (d->n_static > SIZE_MAX / 64 / d->counts[i])
            d->n_static = SIZE_MAX / 64;
        else
            d->n_static *= d->counts[i];
    }
    d->n_start = (size_t)config->data.start;
    d->n_online = (size_t)config->data.online;
    d->n_holdout = (size_t)config->data.holdout;

    // what fits: static grid and held-out maps always, then as many random maps as there is room
    // for
    const double map_bytes = 2.0 * (double)d->n_voxels;
    const double room = bytes / map_bytes - (double)d->n_static - 2.0 * (double)d->n_holdout;
    if (room < (double)d->n_start || room < 1)
        return sdm_fail(
            err, SDM_E_CONFIG,
            "%s: data.static (%zu maps), data.start (%zu) and data.holdout (%zu) need %.1f GB, "
            "data.memory_gb is %g: raise it, or make fewer maps or a coarser grid",
            config->file, d->n_static, d->n_start, d->n_holdout,
            ((double)d->n_static + (double)d->n_start + 2.0 * (double)d->n_holdout) * map_bytes *
                1e-9,
            config->data.memory_gb);
    const size_t n_random = d->n_start + d->n_online;
    d->n_ring = room < (double)n_random ? (size_t)room : n_random;
    d->n_slots = d->n_static + d->n_ring;
    if (d->n_static + d->n_start == 0)
        return sdm_fail(err, SDM_E_CONFIG,
                        "%s: data.static and data.start give no map to start from", config->file);
    sdm_status s = SDM_ALLOC(&d->params, d->n_slots * d->n_params, "training parameters", err);
    size_t count = 0;
    if (!s) s = sdm_mul(d->n_slots, d->n_voxels, &count, err);
    if (!s) s = SDM_ALLOC(&d->maps, count, "training maps", err);
    if (!s) s = SDM_ALLOC(&d->scale, d->n_slots, "training maps", err);
    if (!s)
        s = SDM_ALLOC(&d->holdout_params, d->n_holdout * d->n_params, "held-out parameters", err);
    if (!s) s = sdm_mul(d->n_holdout, d->n_voxels, &count, err);
    if (!s) s = SDM_ALLOC(&d->holdout, count, "held-out maps", err);
    if (!s)
        s = sample_plan_create(&d->plan, config->data.sampling == SDM_SAMPLING_ERROR, n_random,
                               err);
    return s;
}

void dataset_dispose(dataset *d)
{
    sdm_free(d->params);
    sdm_free(d->maps);
    sdm_free(d->scale);
    sdm_free(d->holdout_params);
    sdm_free(d->holdout);
    sample_plan_dispose(&d->plan);
    *d = (dataset){0};
}

sample_space dataset_space(const dataset *d)
{
    return (sample_space){.n_params = d->n_params, .min = d->min, .max = d->max, .seed = d->seed};
}

size_t dataset_slot(const dataset *d, size_t index) { return d->n_static + index % d->n_ring; }

size_t dataset_random_slots(const dataset *d)
{
    return d->n_taken < d->n_ring ? d->n_taken : d->n_ring;
}

size_t dataset_draw(const dataset *d, uint64_t stream, double share, size_t batch, uint64_t step,
                    size_t i)
{
    const size_t n_random = dataset_random_slots(d);
    bool from_grid = (double)i < share * (double)batch;
    if (!d->n_static) from_grid = false;
    if (!n_random) from_grid = true;
    const uint64_t counter = step * batch + i;
    if (from_grid) return (size_t)sdm_rng_below(d->seed, stream, counter, d->n_static);
    return d->n_static + (size_t)sdm_rng_below(d->seed, stream, counter, n_random);
}

void dataset_map(const dataset *d, size_t slot, float *map)
{
    const int16_t *from = d->maps + slot * d->n_voxels;
    const float scale = d->scale[slot];
    for (size_t i = 0; i < d->n_voxels; i++) map[i] = scale * (float)from[i];
}

// parameters of point `index` of the static grid: ends included, the middle when there is one point
static void static_params(const dataset *d, size_t index, double *p)
{
    for (size_t i = 0; i < d->n_params; i++) {
        const size_t n = d->counts[i], k = index % n;
        index /= n;
        p[i] = n == 1 ? 0.5 * (d->min[i] + d->max[i])
                      : d->min[i] + (d->max[i] - d->min[i]) * (double)k / (double)(n - 1);
        if (k + 1 == n && n > 1) p[i] = d->max[i];
    }
}

sdm_status dataset_fill(dataset *d, int n_threads, const fill_hooks *hooks, sdm_error *err)
{
    enum { FEWEST = 128 }; // random maps that bases are made from in any case
    const size_t all = d->n_holdout + d->n_static + d->n_start;
    size_t done = 0;
    long failed = -1; // lowest failed sample: the message does not depend on scheduling
    sdm_error first = {0};
    atomic_bool stop = false, enough = false;
    n_threads = sdm_threads(n_threads);
#pragma omp parallel num_threads(n_threads)
    {
        workbench w = {0};
        sdm_error mine = {0};
        const sdm_status made = workbench_create(&w, d, &mine);
#pragma omp for schedule(dynamic)
        for (long i = 0; i < (long)all; i++) {
            const size_t at = (size_t)i;
            if (stop || (enough && at >= d->n_holdout + d->n_static + FEWEST)) continue;
            sdm_status s = made;
            if (!s && at < d->n_holdout) {
                double *p = d->holdout_params + at * d->n_params;
                sdm_sample_params(d->seed, STREAM_HOLDOUT, at, d->min, d->max, d->n_params, p);
                s = workbench_map(&w, d, p, d->holdout + at * d->n_voxels, &mine);
            } else if (!s) {
                const size_t slot =
                    at -
                    d->n_holdout; // n_start <= n_ring: random sample k lies in slot n_static + k
                double *p = d->params + slot * d->n_params;
                if (slot < d->n_static)
                    static_params(d, slot, p);
                else
                    sdm_sample_params(d->seed, STREAM_TRAIN, slot - d->n_static, d->min, d->max,
                                      d->n_params, p);
                s = workbench_packed_map(&w, d, p, d->maps + slot * d->n_voxels, &d->scale[slot],
                                         &mine);
            }
#pragma omp critical(sdm_dataset_fill)
            {
                if (s && (failed < 0 || i < failed)) failed = i, first = mine;
                if (s) stop = true;
                done++;
                if (hooks->report && sdm_thread() == 0) hooks->report(hooks->user, done, all);
                if (hooks->enough && hooks->enough(hooks->user)) enough = true;
                if (hooks->cancelled && !stop && hooks->cancelled(hooks->user)) {
                    stop = true;
                    failed = (long)all;
                    sdm_fail(&first, SDM_E_CANCELLED, "stopped on request");
                }
            }
        }
        workbench_dispose(&w);
    }
    if (failed >= 0) {
        if (err) *err = first;
        return first.status;
    }
    // a map that was made has a scale; those behind the first that was not are made again during
    // training
    size_t made = 0;
    while (made < d->n_start && d->scale[d->n_static + made] > 0) made++;
    d->n_online += d->n_start - made;
    d->n_taken = d->n_start = made;
    if (d->plan.n_planned == 0)
        sample_plan_start(&d->plan, made); // else it is that of a checkpoint
    return SDM_OK;
}
