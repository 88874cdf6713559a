/* Adam, the average of the weights and the learning rate. */
#include "optimiser.h"

#include <math.h>

#include "sdm/internal/team.h"
#include "sdm/memory.h"

/* Steps between two updates of the average, since an update reads and writes all weights. */
enum { AVERAGE_EVERY = 8 };

#define DECAY_M 0.9f

sdm_status trainer_parameters_create(parameters *p, size_t n, sdm_error *err)
{
    *p = (parameters){.n = n, .best_mse = INFINITY, .gain_mse = INFINITY};
    sdm_status s = SDM_ALLOC(&p->w, n, "weights", err);
    if (!s) s = SDM_ALLOC(&p->m, n, "optimiser state", err);
    if (!s) s = SDM_ALLOC(&p->v, n, "optimiser state", err);
    if (!s) s = SDM_ALLOC(&p->average, n, "weight average", err);
    if (!s) s = SDM_ALLOC(&p->best, n, "best weights", err);
    return s;
}

void trainer_parameters_dispose(parameters *p)
{
    sdm_free(p->w);
    sdm_free(p->m);
    sdm_free(p->v);
    sdm_free(p->average);
    sdm_free(p->best);
    *p = (parameters){0};
}

adam_step trainer_adam_begin(double rate, double decay, int64_t t)
{
    return (adam_step){.rate = (float)rate,
                       .decay_v = (float)decay,
                       .correct_m = (float)(1 / (1 - pow((double)DECAY_M, (double)t))),
                       .correct_v = (float)(1 / (1 - pow((double)(float)decay, (double)t)))};
}

void trainer_adam_update(parameters *p, size_t first, size_t n, const float *g, adam_step step,
                         float scale)
{
    float *restrict w = p->w + first, *restrict m = p->m + first, *restrict v = p->v + first;
    const float rate = step.rate * scale;
    for (size_t i = 0; i < n; i++) {
        m[i] = DECAY_M * m[i] + (1 - DECAY_M) * g[i];
        v[i] = step.decay_v * v[i] + (1 - step.decay_v) * g[i] * g[i];
        w[i] -= rate * (m[i] * step.correct_m) / (sqrtf(v[i] * step.correct_v) + 1e-12f);
    }
}

/* Weights that a thread updates at a time. */
enum { SLICE = 16384 };

static size_t n_slices(const parameters *p) { return (p->n + SLICE - 1) / SLICE; }

static size_t slice_length(const parameters *p, size_t first)
{
    return p->n - first < SLICE ? p->n - first : SLICE;
}

/* An update of all weights. */
typedef struct update {
    parameters *p;
    const float *gradient;
    adam_step step;
    float follow; // average += follow * (w - average); 0: the average stays
} update;

static void adam_slice(void *user, size_t index, int member)
{
    const update *u = user;
    const size_t first = index * SLICE;
    (void)member;
    trainer_adam_update(u->p, first, slice_length(u->p, first), u->gradient + first, u->step, 1);
}

void trainer_adam_update_all(parameters *p, const float *g, adam_step step, int n_threads)
{
    update u = {.p = p, .gradient = g, .step = step};
    sdm_team_run(n_threads, n_slices(p), adam_slice, &u);
}

static void average_slice(void *user, size_t index, int member)
{
    const update *u = user;
    const size_t first = index * SLICE, n = slice_length(u->p, first);
    float *restrict average = u->p->average + first;
    const float *restrict w = u->p->w + first;
    (void)member;
    for (size_t i = 0; i < n; i++) average[i] += u->follow * (w[i] - average[i]);
}

void trainer_average_update(parameters *p, double decay, int n_threads)
{
    update u = {.p = p, .follow = (float)(1 - decay)};
    sdm_team_run(n_threads, n_slices(p), average_slice, &u);
}

void trainer_average_follow(parameters *p, double decay, int64_t step, bool last, int n_threads)
{
    if (step % AVERAGE_EVERY && !last) return;
    // the average follows the weights closely at first and then more and more slowly
    const double n = (double)step / AVERAGE_EVERY;
    trainer_average_update(p, decay > 0 ? fmin(pow(decay, AVERAGE_EVERY), n / (n + 10)) : 0,
                           n_threads);
}

double trainer_rate_schedule(double fraction, double warmup)
{
    if (fraction < warmup) return fraction / warmup;
    const double f = (fraction - warmup) / (1 - warmup);
    return 0.5 * (1 + cos(3.14159265358979323846 * (f < 1 ? f : 1)));
}
