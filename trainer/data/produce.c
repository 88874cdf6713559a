/* Making of exact maps: one at a time on a bench, many in the background. */
#include "produce.h"

#include <math.h>
#include <pthread.h>
#include <string.h>

#include "sdm/memory.h"
#include "streams.h"

sdm_status workbench_create(workbench *w, const dataset *d, sdm_error *err)
{
    const sdm_status s = SDM_ALLOC(&w->map, d->n_voxels, "exact map", err);
    return s ? s : SDM_ALLOC(&w->blocked, d->n_voxels, "exact map", err);
}

void workbench_dispose(workbench *w)
{
    sdm_mesh_dispose(&w->mesh);
    sdm_free(w->map);
    sdm_free(w->blocked);
    *w = (workbench){0};
}

sdm_status workbench_map(workbench *w, const dataset *d, const double *p, float *blocked,
                         sdm_error *err)
{
    sdm_status s = sdm_instance_mesh(d->shape, p, &w->mesh, err);
    if (s) return s;
    const sdm_exact_opts opts = {.n_threads = 1};
    sdm_exact *exact = NULL;
    s = sdm_exact_create(&w->mesh, &opts, &exact, err);
    if (!s) s = sdm_exact_map(exact, d->grid, w->map, err);
    sdm_exact_free(exact);
    if (s) return sdm_fail_in(err, s, "shape '%s'", sdm_instance_shape(d->shape)->name);
    sdm_pod_gather(d->grid, d->blocks, d->n_blocks, w->map, blocked);
    return SDM_OK;
}

sdm_status workbench_packed_map(workbench *w, const dataset *d, const double *p, int16_t *packed,
                                float *scale, sdm_error *err)
{
    const sdm_status s = workbench_map(w, d, p, w->blocked, err);
    if (s) return s;
    float largest = 0;
    for (size_t i = 0; i < d->n_voxels; i++) largest = fmaxf(largest, fabsf(w->blocked[i]));
    if (!(largest > 0)) largest = 1;
    *scale = largest / 32767.0f;
    const float inverse = 32767.0f / largest;
    for (size_t i = 0; i < d->n_voxels; i++) packed[i] = (int16_t)lrintf(w->blocked[i] * inverse);
    return SDM_OK;
}

// a window of samples between the workers and the trainer: sample i waits in place i mod WINDOW
enum { WINDOW = 64, MAX_WORKERS = 256 };

struct producer {
    dataset *d;
    pthread_mutex_t lock;
    pthread_cond_t made, taken;
    size_t next, end; // sample to be made next; behind the last one
    size_t allowed;   // behind the last one whose point is planned
    size_t base;      // first sample not taken yet
    bool done[WINDOW];
    double *params; // [WINDOW][P]
    int16_t *maps;  // [WINDOW][n_voxels]
    float scale[WINDOW];
    sdm_error error; // of the lowest failed sample
    size_t failed;
    bool stop;
    int n_workers;
    pthread_t workers[MAX_WORKERS];
};

static void *work(void *user)
{
    producer *p = user;
    const dataset *d = p->d;
    workbench w = {0};
    sdm_error err = {0};
    const sdm_status made = workbench_create(&w, d, &err);
    pthread_mutex_lock(&p->lock);
    for (;;) {
        while (!p->stop && p->next < p->end &&
               (p->next >= p->base + WINDOW || p->next >= p->allowed))
            pthread_cond_wait(&p->taken, &p->lock);
        if (p->stop || p->next >= p->end) break;
        const size_t index = p->next++, place = index % WINDOW;
        pthread_mutex_unlock(&p->lock);
        double *params = p->params + place * d->n_params;
        sdm_sample_params(d->seed, STREAM_TRAIN, sample_plan_point(&d->plan, index), d->min, d->max,
                          d->n_params, params);
        const sdm_status s =
            made ? made
                 : workbench_packed_map(&w, d, params, p->maps + place * d->n_voxels,
                                        &p->scale[place], &err);
        pthread_mutex_lock(&p->lock);
        p->done[place] = true;
        if (s && index < p->failed) {
            p->failed = index;
            p->error = err;
        }
        pthread_cond_broadcast(&p->made);
    }
    pthread_mutex_unlock(&p->lock);
    workbench_dispose(&w);
    return NULL;
}

sdm_status producer_start(dataset *d, size_t first, int n_threads, producer **out, sdm_error *err)
{
    *out = NULL;
    producer *p = NULL;
    sdm_status s = SDM_ALLOC(&p, 1, "sample producer", err);
    if (s) return s;
    p->d = d;
    p->next = p->base = first;
    p->end = d->n_start + d->n_online;
    p->allowed = d->plan.n_planned;
    p->failed = SIZE_MAX;
    pthread_mutex_init(&p->lock, NULL);
    pthread_cond_init(&p->made, NULL);
    pthread_cond_init(&p->taken, NULL);
    s = SDM_ALLOC(&p->params, WINDOW * d->n_params, "sample window", err);
    if (!s) s = SDM_ALLOC(&p->maps, WINDOW * d->n_voxels, "sample window", err);
    for (; !s && p->n_workers < n_threads && p->n_workers < MAX_WORKERS; p->n_workers++) {
        if (pthread_create(&p->workers[p->n_workers], NULL, work, p)) {
            if (p->n_workers == 0)
                s = sdm_fail(err, SDM_E_NOMEM, "cannot start a thread that makes samples");
            break;
        }
    }
    if (s)
        producer_stop(p);
    else
        *out = p;
    return s;
}

void producer_allow(producer *p, size_t n_planned)
{
    pthread_mutex_lock(&p->lock);
    p->allowed = n_planned;
    pthread_cond_broadcast(&p->taken);
    pthread_mutex_unlock(&p->lock);
}

size_t producer_ready(producer *p)
{
    pthread_mutex_lock(&p->lock);
    size_t n = 0;
    while (n < WINDOW && p->done[(p->base + n) % WINDOW]) n++;
    pthread_mutex_unlock(&p->lock);
    return n;
}

sdm_status producer_take(producer *p, size_t until, sdm_error *err)
{
    dataset *d = p->d;
    if (until > p->end) until = p->end;
    while (p->base < until) {
        const size_t place = p->base % WINDOW;
        pthread_mutex_lock(&p->lock);
        while (!p->done[place]) pthread_cond_wait(&p->made, &p->lock);
        const bool failed = p->base == p->failed;
        pthread_mutex_unlock(&p->lock);
        if (failed) {
            if (err) *err = p->error;
            return p->error.status;
        }
        // the place is the trainer's until `base` moves on
        const size_t slot = dataset_slot(d, p->base);
        memcpy(d->params + slot * d->n_params, p->params + place * d->n_params,
               d->n_params * sizeof *d->params);
        memcpy(d->maps + slot * d->n_voxels, p->maps + place * d->n_voxels,
               d->n_voxels * sizeof *d->maps);
        d->scale[slot] = p->scale[place];
        pthread_mutex_lock(&p->lock);
        p->done[place] = false;
        p->base++;
        d->n_taken = p->base;
        pthread_cond_broadcast(&p->taken);
        pthread_mutex_unlock(&p->lock);
    }
    return SDM_OK;
}

void producer_stop(producer *p)
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
    sdm_free(p->params);
    sdm_free(p->maps);
    sdm_free(p);
}
