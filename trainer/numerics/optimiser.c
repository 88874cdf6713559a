/* Adam, the average of the weights and the learning rate. */
#include "optimiser.h"

#include <math.h>

#include "sdm/memory.h"

#define BETA1 0.9f
#define BETA2 0.999f

sdm_status trainer_parameters_create(parameters *p, size_t n, sdm_error *err)
{
    *p = (parameters){.n = n};
    sdm_status s = SDM_ALLOC(&p->w, n, "weights", err);
    if (!s) s = SDM_ALLOC(&p->m, n, "optimiser state", err);
    if (!s) s = SDM_ALLOC(&p->v, n, "optimiser state", err);
    if (!s) s = SDM_ALLOC(&p->average, n, "weight average", err);
    return s;
}

void trainer_parameters_dispose(parameters *p)
{
    sdm_free(p->w);
    sdm_free(p->m);
    sdm_free(p->v);
    sdm_free(p->average);
    *p = (parameters){0};
}

adam_step trainer_adam_begin(double rate, int64_t t)
{
    return (adam_step){.rate = (float)rate,
                       .correct_m = (float)(1 / (1 - pow((double)BETA1, (double)t))),
                       .correct_v = (float)(1 / (1 - pow((double)BETA2, (double)t)))};
}

void trainer_adam_update(parameters *p, size_t first, size_t n, const float *g, adam_step step,
                         float scale)
{
    float *restrict w = p->w + first, *restrict m = p->m + first, *restrict v = p->v + first;
    const float rate = step.rate * scale;
    for (size_t i = 0; i < n; i++) {
        m[i] = BETA1 * m[i] + (1 - BETA1) * g[i];
        v[i] = BETA2 * v[i] + (1 - BETA2) * g[i] * g[i];
        w[i] -= rate * (m[i] * step.correct_m) / (sqrtf(v[i] * step.correct_v) + 1e-12f);
    }
}

void trainer_average_update(parameters *p, double decay, int n_threads)
{
    enum { SLICE = 16384 };
    const float f = (float)(1 - decay);
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads)
    for (long at = 0; at < (long)p->n; at += SLICE) {
        const size_t first = (size_t)at, last = first + SLICE < p->n ? first + SLICE : p->n;
        for (size_t i = first; i < last; i++) p->average[i] += f * (p->w[i] - p->average[i]);
    }
}

double trainer_rate_schedule(double fraction, double warmup)
{
    if (fraction < warmup) return fraction / warmup;
    const double f = (fraction - warmup) / (1 - warmup);
    return 0.5 * (1 + cos(3.14159265358979323846 * (f < 1 ? f : 1)));
}
