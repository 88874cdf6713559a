/* Moves new maps from the producer into the pool, tells the kind of network about them, and plans
   where the next samples are drawn. */
#include "new_samples.h"

#include <math.h>

#include "kind.h"
#include "progress.h"

sdm_status trainer_samples_start(trainer *t, sdm_error *err)
{
    const dataset *d = &t->data;
    if (d->n_taken >= d->n_start + d->n_online) return SDM_OK;
    return trainer_producer_start(&t->data, d->n_taken, trainer_workers(t), &t->producer, err);
}

size_t trainer_samples_wanted(const trainer *t, double fraction)
{
    const size_t all = t->data.n_start + t->data.n_online;
    const double wanted =
        (double)t->data.n_start + (double)t->data.n_online * fmin(1, fraction / 0.75);
    return wanted < (double)all ? (size_t)wanted : all;
}

/* Takes the next n <= SAMPLE_ROUND samples from the producer; slots[n] = their slots in the
 * pool. */
static sdm_status samples_take_group(trainer *t, size_t n, size_t *slots, sdm_error *err)
{
    dataset *d = &t->data;
    for (size_t i = 0; i < n; i++) slots[i] = trainer_dataset_slot(d, d->n_taken + i);
    const sdm_status s = trainer_producer_take(t->producer, d->n_taken + n, err);
    if (s || !t->kind->samples_taken) return s;
    return t->kind->samples_taken(t, slots, n, err);
}

/* Error-driven sampling: records the error on n new samples, on which the network has not trained
 * yet, and plans the next samples accordingly. */
static sdm_status samples_plan_ahead(trainer *t, const size_t *slots, size_t n, sdm_error *err)
{
    double error[SAMPLE_ROUND];
    dataset *d = &t->data;
    if (!d->plan.by_error) return SDM_OK;
    sdm_status s = SDM_OK;
    if (t->phase == SDM_PHASE_MODE_FIT) {
        s = t->kind->errors(t, slots, n, error, err);
        if (!s) trainer_sample_plan_observe(&d->plan, d->n_taken - n, n, error);
    }
    const sample_space space = trainer_dataset_space(d);
    if (!s) s = trainer_sample_plan_extend(&d->plan, &space, d->n_start, d->n_taken, err);
    trainer_producer_allow(t->producer, d->plan.n_planned);
    return s;
}

sdm_status trainer_samples_take(trainer *t, size_t wanted, sdm_error *err)
{
    if (!t->producer) return SDM_OK;
    dataset *d = &t->data;
    const size_t all = d->n_start + d->n_online;
    // number of random samples in the pool afterwards: whole rounds, except at the end
    size_t until;
    if (trainer_by_time(t)) {
        const size_t ready = trainer_producer_ready(t->producer);
        if (ready < SAMPLE_ROUND && d->n_taken + ready < all) return SDM_OK;
        until = d->n_taken + ready;
    } else {
        until =
            wanted >= all ? all : d->n_start + (wanted - d->n_start) / SAMPLE_ROUND * SAMPLE_ROUND;
    }
    while (d->n_taken < until) {
        size_t slots[SAMPLE_ROUND];
        const size_t n = until - d->n_taken < SAMPLE_ROUND ? until - d->n_taken : SAMPLE_ROUND;
        sdm_status s = samples_take_group(t, n, slots, err);
        if (!s) s = samples_plan_ahead(t, slots, n, err);
        if (s) return s;
        // the wait can be long: report progress and allow the run to be stopped
        if (d->n_taken < until) {
            trainer_report(t, trainer_fraction(t), false);
            if (trainer_all_cancelled(t)) return SDM_OK;
        }
    }
    if (d->n_taken == all) {
        trainer_producer_stop(t->producer);
        t->producer = NULL;
    }
    return SDM_OK;
}

sdm_status trainer_samples_retake(trainer *t, size_t n_taken, sdm_error *err)
{
    while (t->producer && t->data.n_taken < n_taken) {
        size_t slots[SAMPLE_ROUND];
        const size_t left = n_taken - t->data.n_taken;
        sdm_status s = samples_take_group(t, left < SAMPLE_ROUND ? left : SAMPLE_ROUND, slots, err);
        if (!s && trainer_all_cancelled(t))
            s = sdm_fail(err, SDM_E_CANCELLED, "stopped on request");
        if (s) return s;
        trainer_report(t, 0, false);
    }
    return SDM_OK;
}
