/* Computes the maps that are needed before training, on all threads of all ranks. */
#include "dataset_fill.h"

#include <string.h>

#include "dataset_ranks.h"
#include "sdm/internal/clock.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
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

/* true if every rank keeps the same voxels of maps in both data sets. */
static bool same_shares(const dataset *a, const dataset *b)
{
    const size_t ranks = (size_t)sdm_comm_size(a->comm);
    return a->n_voxels == b->n_voxels && !a->share == !b->share &&
           (!a->share || !memcmp(a->share, b->share, (ranks + 1) * sizeof *a->share));
}

/* Copies the map of `slot`, as far as this rank keeps it, from d->known; false: it is not there, on
 * all ranks. */
static bool take_known(const dataset *d, size_t slot)
{
    const dataset *k = d->known;
    const double *p = d->params + slot * d->n_params;
    if (!k || slot < d->n_static || slot - d->n_static >= k->n_start || !same_shares(d, k))
        return false;
    const size_t from = k->n_static + (slot - d->n_static);
    if (memcmp(p, k->params + from * d->n_params, d->n_params * sizeof *p) != 0) return false;
    memcpy(d->maps + slot * d->n_kept, k->maps + from * d->n_kept, d->n_kept * sizeof *d->maps);
    d->scale[slot] = k->scale[from];
    return true;
}

/* The maps while they are made: number i of `all` is a held-out map, then one of the static grid,
   then a random one. */
typedef struct filling {
    dataset *d;
    const fill_hooks *hooks;
    int n_threads;
    size_t all;
    size_t done;     // maps made, by all ranks
    size_t each;     // maps made when this rank has made one
    bool stop;       // after an error, or on request
    long failed;     // lowest number of a map that failed; -1: none. So the message does not
    sdm_error error; // depend on scheduling
    bool enough;
    size_t round; // maps of a round (fill_by_ranks())
    // where ranks keep parts of maps
    size_t most;   // maps that a rank makes in a round
    size_t first;  // the first map that this rank makes in the present round
    int16_t *made; // [most][n_voxels] the maps of this rank in the round; NULL: into their slots
    size_t *slots; // [ranks] arguments of trainer_dataset_spread()
} filling;

/* Makes map number `at`. */
static sdm_status fill_one(const filling *f, workbench *w, size_t at, sdm_error *err)
{
    const dataset *d = f->d;
    if (at < d->n_holdout) {
        double *p = d->holdout_params + at * d->n_params;
        trainer_dataset_holdout_params(d, at, p);
        return take_holdout(d, at, p)
                   ? SDM_OK
                   : trainer_workbench_map(w, d, p, d->holdout + at * d->n_voxels, err);
    }
    // n_start <= n_ring, so random sample k lies in slot n_static + k
    const size_t slot = at - d->n_holdout;
    double *p = d->params + slot * d->n_params;
    if (slot < d->n_static)
        trainer_dataset_static_params(d, slot, p);
    else
        trainer_dataset_random_params(d, slot - d->n_static, p);
    int16_t *to = f->made ? f->made + (at - f->first) * d->n_voxels : d->maps + slot * d->n_kept;
    return take_known(d, slot) ? SDM_OK
                               : trainer_workbench_packed_map(w, d, p, to, &d->scale[slot], err);
}

/* Notes the result of map number `at`, reports progress, and checks whether to stop. One thread at
 * a time. */
static void note_map(filling *f, const workbench *w, size_t at, sdm_status s, const sdm_error *err)
{
    const fill_hooks *hooks = f->hooks;
    if (s && (f->failed < 0 || (long)at < f->failed)) f->failed = (long)at, f->error = *err;
    if (s) f->stop = true;
    if (at < f->d->n_holdout && w->inside) f->d->inside = true;
    f->done = f->done + f->each < f->all ? f->done + f->each : f->all;
    if (hooks->report && sdm_thread() == 0) hooks->report(hooks->user, f->done, f->all);
    if (hooks->enough && hooks->enough(hooks->user)) f->enough = true;
    if (hooks->cancelled && !f->stop && hooks->cancelled(hooks->user)) {
        f->stop = true;
        f->failed = (long)f->all;
        sdm_fail(&f->error, SDM_E_CANCELLED, "stopped on request");
    }
}

/* Makes the maps begin .. end - 1 on all threads of this rank. */
static sdm_status fill_range(filling *f, size_t begin, size_t end, sdm_error *err)
{
    const dataset *d = f->d;
#pragma omp parallel num_threads(f->n_threads)
    {
        workbench w = {0};
        sdm_error mine = {0};
        const sdm_status made = trainer_workbench_create(&w, d, &mine);
#pragma omp for schedule(dynamic)
        for (long i = (long)begin; i < (long)end; i++) {
            const size_t at = (size_t)i;
            bool skip;
#pragma omp critical(sdm_dataset_fill)
            skip = f->stop || (f->enough && at >= d->n_holdout + d->n_static + FILL_LEAST_RANDOM);
            if (skip) continue;
            const sdm_status s = made ? made : fill_one(f, &w, at, &mine);
#pragma omp critical(sdm_dataset_fill)
            note_map(f, &w, at, s, &mine);
        }
        trainer_workbench_dispose(&w);
    }
    if (f->failed < 0) return SDM_OK;
    if (err) *err = f->error;
    return f->error.status;
}

static void limit_round(filling *f)
{
    const size_t most = f->most * (size_t)sdm_comm_size(f->d->comm);
    if (f->most && f->round > most) f->round = most;
}

/* Decides on rank 0, for all: whether the maps are enough, and the number of maps of the next
 * round. started: when this round began. */
static sdm_status decide(filling *f, double started, sdm_error *err)
{
    // ranks wait for the slowest one at the end of a round, and are interrupted there
    static const double SHORT = 0.25; // s
    if (sdm_clock() - started < SHORT) f->round *= 2;
    limit_round(f);
    size_t all[] = {f->enough, f->round};
    const sdm_status s = sdm_comm_broadcast(f->d->comm, 0, all, sizeof all, err);
    f->enough = all[0] != 0;
    f->round = all[1];
    return s;
}

/* Sends the n maps of a round, in slots from `slot` on, from the ranks that have made them, one of
 * each rank at a time. */
static sdm_status spread_round(filling *f, size_t slot, size_t n, sdm_error *err)
{
    dataset *d = f->d;
    sdm_status s = SDM_OK;
    for (size_t i = 0; i < sdm_comm_first(d->comm, n, 1) && !s; i++) {
        for (int r = 0; r < sdm_comm_size(d->comm); r++) {
            const size_t at = sdm_comm_first(d->comm, n, r) + i;
            f->slots[r] = at < sdm_comm_first(d->comm, n, r + 1) && !take_known(d, slot + at)
                              ? slot + at
                              : SIZE_MAX;
        }
        s = trainer_dataset_spread(d, f->made + i * d->n_voxels, f->slots, err);
    }
    return s;
}

/* Makes the maps begin .. end - 1, all of them held-out or none, on all ranks, and gives all to
 * each. */
static sdm_status fill_round(filling *f, size_t begin, size_t end, sdm_error *err)
{
    dataset *d = f->d;
    sdm_comm *comm = d->comm;
    const size_t n = end - begin, p = d->n_params, v = d->n_voxels;
    const int rank = sdm_comm_rank(comm);
    const double started = sdm_clock();
    f->first = begin + sdm_comm_first(comm, n, rank);
    sdm_status s = fill_range(f, f->first, begin + sdm_comm_first(comm, n, rank + 1), err);
    s = sdm_comm_agree(comm, s, err);
    const bool holdout = begin < d->n_holdout;
    const size_t slot = holdout ? 0 : begin - d->n_holdout;
    double *params = holdout ? d->holdout_params + begin * p : d->params + slot * p;
    if (!s) s = sdm_comm_gather_shares(comm, params, n, p * sizeof *params, err);
    if (holdout && !s)
        s = sdm_comm_gather_shares(comm, d->holdout + begin * v, n, v * sizeof *d->holdout, err);
    if (!holdout && !s) s = sdm_comm_gather_shares(comm, d->scale + slot, n, sizeof *d->scale, err);
    if (!holdout && !d->share && !s)
        s = sdm_comm_gather_shares(comm, d->maps + slot * v, n, v * sizeof *d->maps, err);
    if (!holdout && d->share && !s) s = spread_round(f, slot, n, err);
    f->done = end;
    return s ? s : decide(f, started, err);
}

/* d->inside becomes true if it is so on any rank. */
static sdm_status share_inside(dataset *d, sdm_error *err)
{
    size_t outside = !d->inside;
    const sdm_status s = sdm_comm_least(d->comm, &outside, err);
    d->inside = !outside;
    return s;
}

/* Allocates the memory of the maps that this rank makes in a round: at most 64 MB, but a map for
 * each thread. */
static sdm_status make_room(filling *f, size_t threads, sdm_error *err)
{
    enum { BYTES = 64000000 };
    const dataset *d = f->d;
    size_t count = 0;
    f->most = BYTES / (d->n_voxels * sizeof *f->made);
    if (f->most < threads) f->most = threads;
    sdm_status s = sdm_mul(f->most, d->n_voxels, &count, err);
    if (!s) s = SDM_ALLOC(&f->made, count, "maps of a rank", err);
    return s ? s : SDM_ALLOC(&f->slots, f->each, "maps of a rank", err);
}

/* Makes the maps in rounds, after each of which all ranks know whether to stop. */
static sdm_status fill_by_ranks(filling *f, sdm_error *err)
{
    enum { PER_THREAD = 16 };
    dataset *d = f->d;
    int threads = f->n_threads;
    sdm_status s = sdm_comm_broadcast(d->comm, 0, &threads, sizeof threads, err);
    f->each = (size_t)sdm_comm_size(d->comm);
    f->round = (size_t)threads * PER_THREAD * f->each;
    if (!s && d->share) s = make_room(f, (size_t)threads, err);
    limit_round(f);
    for (size_t at = 0, end; at < f->all && !s; at = end) {
        const size_t until = at < d->n_holdout ? d->n_holdout : f->all;
        end = until - at < f->round ? until : at + f->round;
        s = fill_round(f, at, end, err);
    }
    return s ? s : share_inside(d, err);
}

sdm_status trainer_dataset_fill(dataset *d, int n_threads, const fill_hooks *hooks, sdm_error *err)
{
    filling f = {.d = d,
                 .hooks = hooks,
                 .n_threads = sdm_threads(n_threads),
                 .all = d->n_holdout + d->n_static + d->n_start,
                 .each = 1,
                 .failed = -1};
    if (d->known) d->inside = d->known->inside;
    const sdm_status s = d->comm ? fill_by_ranks(&f, err) : fill_range(&f, 0, f.all, err);
    sdm_free(f.made);
    sdm_free(f.slots);
    if (s) return s;
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
