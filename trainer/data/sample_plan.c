/* The thinning of the Sobol' sequence: points are accepted or rejected by their density. */
#include "sample_plan.h"

#include <math.h>

#include "error_model.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"
#include "streams.h"

static const double FLOOR = 0.5, CAP = 7;

sdm_status sample_plan_create(sample_plan *p, bool by_error, size_t n, sdm_error *err)
{
    *p = (sample_plan){.by_error = by_error, .n = n, .n_planned = by_error ? 0 : n};
    if (!by_error) return SDM_OK;
    sdm_status s = SDM_ALLOC(&p->point, n, "sampling plan", err);
    if (!s) s = SDM_ALLOC(&p->error, n, "sampling plan", err);
    for (size_t i = 0; i < n && !s; i++) p->error[i] = NAN;
    return s;
}

void sample_plan_dispose(sample_plan *p)
{
    sdm_free(p->point);
    sdm_free(p->error);
    *p = (sample_plan){0};
}

uint64_t sample_plan_point(const sample_plan *p, size_t index)
{
    return p->by_error ? p->point[index] : index;
}

// whole rounds, counted from n_start: that of sample n_taken and the next
static size_t horizon(const sample_plan *p, size_t n_start, size_t n_taken)
{
    const size_t rounds = (n_taken - n_start) / SAMPLE_ROUND + 2;
    return rounds < (p->n - n_start) / SAMPLE_ROUND ? n_start + rounds * SAMPLE_ROUND : p->n;
}

void sample_plan_start(sample_plan *p, size_t n_start)
{
    if (!p->by_error) return;
    p->n_planned = horizon(p, n_start, n_start);
    for (size_t i = 0; i < p->n_planned; i++) p->point[i] = i;
}

void sample_plan_observe(sample_plan *p, size_t first, size_t n, const double *error)
{
    float *e = p->error + first;
    double sum = 0;
    size_t met = 0;
    for (size_t i = 0; i < n; i++) {
        e[i] = (float)log(error[i]);
        if (isfinite(e[i])) sum += e[i], met++;
    }
    // relative to the others of the round: the error falls everywhere while training goes on
    for (size_t i = 0; i < n; i++) e[i] = isfinite(e[i]) ? e[i] - (float)(sum / (double)met) : NAN;
}

// the point's parameters, scaled to -1 .. 1
static void place(const sample_space *space, uint64_t point, double *x)
{
    sdm_sample_params(space->seed, STREAM_TRAIN, point, space->min, space->max, space->n_params, x);
    for (size_t k = 0; k < space->n_params; k++)
        x[k] = 2 * (x[k] - space->min[k]) / (space->max[k] - space->min[k]) - 1;
}

// from the last observations before sample `end`
static sdm_status regress(const sample_plan *p, const sample_space *space, size_t n_start,
                          size_t end, error_model *m, sdm_error *err)
{
    enum { MOST = 4096 };
    const size_t first = end - n_start > MOST ? end - MOST : n_start;
    double *x = NULL, *value = NULL;
    sdm_status s = SDM_ALLOC(&x, (end - first) * space->n_params, "sampling plan", err);
    if (!s) s = SDM_ALLOC(&value, end - first, "sampling plan", err);
    size_t n = 0;
    for (size_t i = first; i < end && !s; i++)
        if (isfinite(p->error[i])) {
            place(space, p->point[i], x + n * space->n_params);
            value[n++] = p->error[i];
        }
    if (!s) s = error_model_fit(m, space->n_params, n, x, value, err);
    sdm_free(value);
    sdm_free(x);
    return s;
}

static void plan_round(sample_plan *p, const sample_space *space, const error_model *m, size_t end)
{
    enum { LOOK = 256 };
    uint64_t next = p->n_planned ? p->point[p->n_planned - 1] + 1 : 0;
    double x[SDM_POD_MAX_PARAMS], mean = 0;
    for (uint64_t i = 0; i < LOOK; i++) {
        place(space, next + i, x);
        mean += exp(error_model_at(m, x)) / LOOK;
    }
    const double most = FLOOR + (1 - FLOOR) * CAP;
    for (; p->n_planned < end; next++) {
        if (m->degree > 0) { // else the error is the same everywhere, and every point is taken
            place(space, next, x);
            const double density =
                FLOOR + (1 - FLOOR) * fmin(exp(error_model_at(m, x)) / mean, CAP);
            if (!(sdm_rng_uniform(space->seed, STREAM_PLAN, next) * most < density)) continue;
        }
        p->point[p->n_planned++] = next;
    }
}

sdm_status sample_plan_extend(sample_plan *p, const sample_space *space, size_t n_start,
                              size_t n_taken, sdm_error *err)
{
    const size_t end = horizon(p, n_start, n_taken);
    if (!p->by_error || p->n_planned >= end) return SDM_OK;
    error_model m;
    const sdm_status s = regress(p, space, n_start, n_taken, &m, err);
    if (s) return s;
    plan_round(p, space, &m, end);
    error_model_dispose(&m);
    return SDM_OK;
}
