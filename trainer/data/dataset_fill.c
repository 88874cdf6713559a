/* Computes the maps that are needed before training, on all threads. */
#include "dataset_fill.h"

#include <stdatomic.h>
#include <string.h>

#include "sdm/internal/threads.h"
#include "workbench.h"

/* Copies held-out map `index` from d->known; false: it is not there. */
static bool take_holdout(const dataset *d, size_t index, const double *p)
{
    const dataset *k = d->known;
    const size_t bytes = d->n_params * sizeof *p;
    if (!k || index >= k->n_holdout || k->n_voxels != d->n_voxels ||
        memcmp(p, k->holdout_params + index * d->n_params, bytes) != 0)
        return false;
    memcpy(d->holdout + index * d->n_voxels, k->holdout + index * d->n_voxels,
           d->n_voxels * sizeof *d->holdout);
    return true;
}

/* Copies the map of `slot`, random sample number `index`, from d->known; false: it is not there. */
static bool take_random(const dataset *d, size_t slot, size_t index, const double *p)
{
    const dataset *k = d->known;
    if (!k || index >= k->n_start || k->n_voxels != d->n_voxels) return false;
    const size_t from = k->n_static + index;
    if (memcmp(p, k->params + from * d->n_params, d->n_params * sizeof *p) != 0) return false;
    memcpy(d->maps + slot * d->n_voxels, k->maps + from * d->n_voxels,
           d->n_voxels * sizeof *d->maps);
    d->scale[slot] = k->scale[from];
    return true;
}

sdm_status trainer_dataset_fill(dataset *d, int n_threads, const fill_hooks *hooks, sdm_error *err)
{
    enum { MIN_RANDOM = 128 }; // random maps made even if hooks->enough() is true
    const size_t all = d->n_holdout + d->n_static + d->n_start;
    size_t done = 0;
    if (d->known) d->inside = d->known->inside;
    long failed = -1; // lowest index of a failed map: so the message does not depend on scheduling
    sdm_error first = {0};
    atomic_bool stop = false, enough = false;
    n_threads = sdm_threads(n_threads);
#pragma omp parallel num_threads(n_threads)
    {
        workbench w = {0};
        sdm_error mine = {0};
        const sdm_status made = trainer_workbench_create(&w, d, &mine);
#pragma omp for schedule(dynamic)
        for (long i = 0; i < (long)all; i++) {
            const size_t at = (size_t)i;
            if (stop || (enough && at >= d->n_holdout + d->n_static + MIN_RANDOM)) continue;
            sdm_status s = made;
            if (!s && at < d->n_holdout) {
                double *p = d->holdout_params + at * d->n_params;
                trainer_dataset_holdout_params(d, at, p);
                if (!take_holdout(d, at, p))
                    s = trainer_workbench_map(&w, d, p, d->holdout + at * d->n_voxels, &mine);
            } else if (!s) {
                // n_start <= n_ring, so random sample k lies in slot n_static + k
                const size_t slot = at - d->n_holdout;
                double *p = d->params + slot * d->n_params;
                if (slot < d->n_static)
                    trainer_dataset_static_params(d, slot, p);
                else
                    trainer_dataset_random_params(d, slot - d->n_static, p);
                if (slot < d->n_static || !take_random(d, slot, slot - d->n_static, p))
                    s = trainer_workbench_packed_map(&w, d, p, d->maps + slot * d->n_voxels,
                                                     &d->scale[slot], &mine);
            }
            // keep the first error, report progress, and check whether to stop
#pragma omp critical(sdm_dataset_fill)
            {
                if (s && (failed < 0 || i < failed)) failed = i, first = mine;
                if (s) stop = true;
                if (at < d->n_holdout && w.inside) d->inside = true;
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
        trainer_workbench_dispose(&w);
    }
    if (failed >= 0) {
        if (err) *err = first;
        return first.status;
    }
    // a slot with a map has scale > 0; maps after the first gap are made again during training
    size_t made = 0;
    while (made < d->n_start && d->scale[d->n_static + made] > 0) made++;
    d->n_online += d->n_start - made;
    d->n_taken = d->n_start = made;
    if (d->plan.n_planned == 0)
        // a resumed run has read its plan from the checkpoint
        trainer_sample_plan_start(&d->plan, made);
    return SDM_OK;
}
