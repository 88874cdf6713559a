/* Thins the Sobol' sequence: each point is accepted or rejected by its density. */
#include "sample_plan.h"

#include <math.h>

#include "error_model.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/sampling.h"
#include "sdm/internal/train.h"
#include "sdm/memory.h"
#include "streams.h"

static const double FLOOR = 0.5, CAP = 7;

sdm_status trainer_sample_plan_create(sample_plan *p, bool by_error, size_t n, sdm_error *err)
{
    *p = (sample_plan){.by_error = by_error, .n = n, .n_planned = by_error ? 0 : n};
    if (!by_error) return SDM_OK;
    sdm_status s = SDM_ALLOC(&p->point, n, "sampling plan", err);
    if (!s) s = SDM_ALLOC(&p->error, n, "sampling plan", err);
    for (size_t i = 0; i < n && !s; i++) p->error[i] = NAN;
    return s;
}

void trainer_sample_plan_dispose(sample_plan *p)
{
    sdm_free(p->point);
    sdm_free(p->error);
    *p = (sample_plan){0};
}

uint64_t trainer_sample_plan_point(const sample_plan *p, size_t index)
{
    return p->by_error ? p->point[index] : index;
}

/* End of the plan: the samples of whole rounds after n_start, up to the round after the one that
 * holds sample n_taken. */
static size_t plan_end(const sample_plan *p, size_t n_start, size_t n_taken)
{
    const size_t rounds = (n_taken - n_start) / SAMPLE_ROUND + 2;
    return rounds < (p->n - n_start) / SAMPLE_ROUND ? n_start + rounds * SAMPLE_ROUND : p->n;
}

void trainer_sample_plan_start(sample_plan *p, size_t n_start)
{
    if (!p->by_error) return;
    p->n_planned = plan_end(p, n_start, n_start);
    for (size_t i = 0; i < p->n_planned; i++) p->point[i] = i;
}

void trainer_sample_plan_observe(sample_plan *p, size_t first, size_t n, const double *error)
{
    float *e = p->error + first;
    double sum = 0;
    size_t n_finite = 0;
    for (size_t i = 0; i < n; i++) {
        e[i] = (float)log(error[i]);
        if (isfinite(e[i])) sum += e[i], n_finite++;
    }
    // relative to the mean of the round: the error of all samples falls while training goes on
    for (size_t i = 0; i < n; i++)
        e[i] = isfinite(e[i]) ? e[i] - (float)(sum / (double)n_finite) : NAN;
}

/* x[n_params] = parameters of a Sobol' point, scaled to -1 .. 1. */
static void point_scaled(const sample_space *space, uint64_t point, double *x)
{
    sdm_sample_params(space->seed, STREAM_TRAIN, point, space->min, space->max, space->distribution,
                      space->n_params, x);
    for (size_t k = 0; k < space->n_params; k++)
        x[k] = 2 * (x[k] - space->min[k]) / (space->max[k] - space->min[k]) - 1;
}

/* Fits the error model to the last MAX_OBSERVATIONS observations before sample `end`. */
static sdm_status fit_errors(const sample_plan *p, const sample_space *space, size_t n_start,
                             size_t end, error_model *m, sdm_error *err)
{
    enum { MAX_OBSERVATIONS = 4096 };
    const size_t first = end - n_start > MAX_OBSERVATIONS ? end - MAX_OBSERVATIONS : n_start;
    double *x = NULL, *value = NULL;
    sdm_status s = SDM_ALLOC(&x, (end - first) * space->n_params, "sampling plan", err);
    if (!s) s = SDM_ALLOC(&value, end - first, "sampling plan", err);
    size_t n = 0;
    for (size_t i = first; i < end && !s; i++)
        if (isfinite(p->error[i])) {
            point_scaled(space, p->point[i], x + n * space->n_params);
            value[n++] = p->error[i];
        }
    if (!s) s = trainer_error_model_fit(m, space->n_params, n, x, value, err);
    sdm_free(value);
    sdm_free(x);
    return s;
}

/* Plans samples up to `end` by rejection, going through the points after the last planned one. */
static void plan_round(sample_plan *p, const sample_space *space, const error_model *m, size_t end)
{
    enum { MEAN_POINTS = 256 };
    uint64_t next = p->n_planned ? p->point[p->n_planned - 1] + 1 : 0;
    double x[SDM_POD_MAX_PARAMS], mean = 0;
    // mean predicted error over the next points
    for (uint64_t i = 0; i < MEAN_POINTS; i++) {
        point_scaled(space, next + i, x);
        mean += exp(trainer_error_model_at(m, x)) / MEAN_POINTS;
    }
    const double max_density = FLOOR + (1 - FLOOR) * CAP;
    for (; p->n_planned < end; next++) {
        // degree 0: a constant error, every point is accepted
        if (m->degree > 0) {
            point_scaled(space, next, x);
            const double density =
                FLOOR + (1 - FLOOR) * fmin(exp(trainer_error_model_at(m, x)) / mean, CAP);
            if (!(sdm_rng_uniform(space->seed, STREAM_PLAN, next) * max_density < density))
                continue;
        }
        p->point[p->n_planned++] = next;
    }
}

sdm_status trainer_sample_plan_extend(sample_plan *p, const sample_space *space, size_t n_start,
                                      size_t n_taken, sdm_error *err)
{
    const size_t end = plan_end(p, n_start, n_taken);
    if (!p->by_error || p->n_planned >= end) return SDM_OK;
    error_model m;
    const sdm_status s = fit_errors(p, space, n_start, n_taken, &m, err);
    if (s) return s;
    plan_round(p, space, &m, end);
    trainer_error_model_dispose(&m);
    return SDM_OK;
}
