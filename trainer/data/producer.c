/* Worker threads that compute random training maps in the background. */
#include "producer.h"

#include <pthread.h>
#include <string.h>

#include "dataset_ranks.h"
#include "sdm/memory.h"
#include "workbench.h"

/* Finished samples wait in a window between the workers and the trainer: sample i in place i mod
 * WINDOW. */
enum { WINDOW = 64, MAX_WORKERS = 256 };

struct producer {
    dataset *d;
    pthread_mutex_t lock;
    pthread_cond_t made, taken;
    size_t next, end; // sample to be made next; end of the samples (one past the last)
    size_t allowed;   // end of the samples whose Sobol' point is planned
    size_t base;      // first sample in the window; all earlier ones are in the pool
    bool done[WINDOW];
    double *params; // [WINDOW][P]
    int16_t *maps;  // [WINDOW][n_voxels]
    float scale[WINDOW];
    sdm_error error; // error of sample `failed`
    size_t failed;   // lowest failed sample; SIZE_MAX: none
    bool stop;
    size_t *slots; // [ranks] SIZE_MAX (trainer_dataset_spread())
    int n_workers;
    pthread_t workers[MAX_WORKERS];
};

/* The rank that makes sample `index`. */
static int maker(const dataset *d, size_t index)
{
    return (int)(index % (size_t)sdm_comm_size(d->comm));
}

/* The first sample from `index` on that this rank makes. */
static size_t next_own(const dataset *d, size_t index)
{
    while (maker(d, index) != sdm_comm_rank(d->comm)) index++;
    return index;
}

/* A worker: computes the next sample as soon as its place in the window is free and its Sobol'
 * point is planned. */
static void *worker_run(void *user)
{
    producer *p = user;
    const dataset *d = p->d;
    workbench w = {0};
    sdm_error err = {0};
    const sdm_status made = trainer_workbench_create(&w, d, &err);
    // claim the next sample
    pthread_mutex_lock(&p->lock);
    for (;;) {
        while (!p->stop && p->next < p->end &&
               (p->next >= p->base + WINDOW || p->next >= p->allowed))
            pthread_cond_wait(&p->taken, &p->lock);
        if (p->stop || p->next >= p->end) break;
        const size_t index = p->next, place = index % WINDOW;
        p->next = next_own(d, index + 1);
        pthread_mutex_unlock(&p->lock);
        // compute it without the lock
        double *params = p->params + place * d->n_params;
        trainer_dataset_random_params(d, trainer_sample_plan_point(&d->plan, index), params);
        const sdm_status s =
            made ? made
                 : trainer_workbench_packed_map(&w, d, params, p->maps + place * d->n_voxels,
                                                &p->scale[place], &err);
        pthread_mutex_lock(&p->lock);
        // publish it
        p->done[place] = true;
        if (s && index < p->failed) {
            p->failed = index;
            p->error = err;
        }
        pthread_cond_broadcast(&p->made);
    }
    pthread_mutex_unlock(&p->lock);
    trainer_workbench_dispose(&w);
    return NULL;
}

sdm_status trainer_producer_start(dataset *d, size_t first, int n_threads, producer **out,
                                  sdm_error *err)
{
    *out = NULL;
    producer *p = NULL;
    sdm_status s = SDM_ALLOC(&p, 1, "sample producer", err);
    if (s) return s;
    p->d = d;
    p->base = first;
    p->next = next_own(d, first);
    p->end = d->n_start + d->n_online;
    p->allowed = d->plan.n_planned;
    p->failed = SIZE_MAX;
    // window and locks
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->made, NULL);
    pthread_cond_init(&p->taken, NULL);
    const size_t ranks = (size_t)sdm_comm_size(d->comm);
    s = SDM_ALLOC(&p->slots, ranks, "sample window", err);
    for (size_t r = 0; r < ranks && !s; r++) p->slots[r] = SIZE_MAX;
    if (!s) s = SDM_ALLOC(&p->params, WINDOW * d->n_params, "sample window", err);
    if (!s) s = SDM_ALLOC(&p->maps, WINDOW * d->n_voxels, "sample window", err);
    // workers: fewer than asked for are enough
    for (; !s && p->n_workers < n_threads && p->n_workers < MAX_WORKERS; p->n_workers++) {
        if (pthread_create(&p->workers[p->n_workers], NULL, worker_run, p)) {
            if (p->n_workers == 0)
                s = sdm_fail(err, SDM_E_NOMEM, "cannot start a thread that makes samples");
            break;
        }
    }
    if (s)
        trainer_producer_stop(p);
    else
        *out = p;
    return s;
}

void trainer_producer_allow(producer *p, size_t n_planned)
{
    pthread_mutex_lock(&p->lock);
    p->allowed = n_planned;
    pthread_cond_broadcast(&p->taken);
    pthread_mutex_unlock(&p->lock);
}

size_t trainer_producer_ready(producer *p)
{
    pthread_mutex_lock(&p->lock);
    size_t n = 0;
    while (n < WINDOW && (maker(p->d, p->base + n) != sdm_comm_rank(p->d->comm) ||
                          p->done[(p->base + n) % WINDOW]))
        n++;
    pthread_mutex_unlock(&p->lock);
    if (n > p->end - p->base) n = p->end - p->base;
    (void)sdm_comm_least(p->d->comm, &n, NULL);
    return n;
}

/* Waits until this rank has made sample number p->base, and puts it into its slot; not the map if
 * ranks keep parts of it. */
static sdm_status take_own(producer *p, size_t slot, sdm_error *err)
{
    const dataset *d = p->d;
    const size_t place = p->base % WINDOW;
    pthread_mutex_lock(&p->lock);
    while (!p->done[place]) pthread_cond_wait(&p->made, &p->lock);
    const bool failed = p->base == p->failed;
    pthread_mutex_unlock(&p->lock);
    if (failed) {
        if (err) *err = p->error;
        return p->error.status;
    }
    // workers do not touch this place until `base` moves on
    memcpy(d->params + slot * d->n_params, p->params + place * d->n_params,
           d->n_params * sizeof *d->params);
    if (!d->share)
        memcpy(d->maps + slot * d->n_kept, p->maps + place * d->n_voxels,
               d->n_voxels * sizeof *d->maps);
    d->scale[slot] = p->scale[place];
    return SDM_OK;
}

/* Sends sample number p->base, which goes into `slot`, from the rank that has made it to the
 * others. */
static sdm_status spread(const producer *p, int root, size_t slot, sdm_error *err)
{
    dataset *d = p->d;
    sdm_status s = sdm_comm_broadcast(d->comm, root, d->params + slot * d->n_params,
                                      d->n_params * sizeof *d->params, err);
    if (!s) s = sdm_comm_broadcast(d->comm, root, d->scale + slot, sizeof *d->scale, err);
    if (s) return s;
    if (!d->share)
        return sdm_comm_broadcast(d->comm, root, d->maps + slot * d->n_kept,
                                  d->n_voxels * sizeof *d->maps, err);
    p->slots[root] = slot;
    s = trainer_dataset_spread(d, p->maps + p->base % WINDOW * d->n_voxels, p->slots, err);
    p->slots[root] = SIZE_MAX;
    return s;
}

sdm_status trainer_producer_take(producer *p, size_t until, sdm_error *err)
{
    dataset *d = p->d;
    if (until > p->end) until = p->end;
    while (p->base < until) {
        const size_t place = p->base % WINDOW, slot = trainer_dataset_slot(d, p->base);
        const int root = maker(d, p->base);
        sdm_status s = root == sdm_comm_rank(d->comm) ? take_own(p, slot, err) : SDM_OK;
        s = sdm_comm_agree(d->comm, s, err);
        if (!s) s = spread(p, root, slot, err);
        if (s) return s;
        // free the place
        pthread_mutex_lock(&p->lock);
        p->done[place] = false;
        p->base++;
        d->n_taken = p->base;
        pthread_cond_broadcast(&p->taken);
        pthread_mutex_unlock(&p->lock);
    }
    return SDM_OK;
}

void trainer_producer_stop(producer *p)
{
    if (!p) return;
    pthread_mutex_lock(&p->lock);
    p->stop = true;
    pthread_cond_broadcast(&p->taken);
    pthread_mutex_unlock(&p->lock);
    for (int i = 0; i < p->n_workers; i++) pthread_join(p->workers[i], NULL);
    pthread_cond_destroy(&p->made);
    pthread_cond_destroy(&p->taken);
    pthread_mutex_destroy(&p->lock);
    sdm_free(p->slots);
    sdm_free(p->params);
    sdm_free(p->maps);
    sdm_free(p);
}
