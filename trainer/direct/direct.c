/* Trains networks that learn by gradients on exact maps: one phase of Adam steps with a running
   average of the weights. */
#include "direct.h"

#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "direct_network.h"
#include "sdm/internal/checksum.h"
#include "sdm/memory.h"
#include "state/checkpoint.h"
#include "state/export_model.h"
#include "state/new_samples.h"
#include "state/progress.h"

typedef struct direct_state {
    const direct_network *kind;
    void *network; // made by kind->create()
    parameters weights;
    float *gradient;       // [weights.n]
    size_t *slots;         // [batch]
    double export_seconds; // expected duration of the final evaluation
} direct_state;

static const direct_network *network_of(sdm_network_kind kind)
{
    switch (kind) {
    case SDM_NETWORK_DEEPSDF:
    case SDM_NETWORK_IMNET:
        return &trainer_network_point;
    case SDM_NETWORK_SDMNN:
        return &trainer_network_sdmnn;
    case SDM_NETWORK_POD:
    case SDM_NETWORK_TEMPLATE:
    case SDM_NETWORK_AUTO:
        break;
    }
    return NULL;
}

/* Block edge 0: these kinds store maps in map order, [nz][ny][nx]. */
static size_t direct_block(const sdm_config *c)
{
    (void)c;
    return 0;
}

static sdm_status direct_begin(trainer *t, sdm_error *err)
{
    direct_state *d = NULL;
    const direct_network *kind = network_of(t->config->network.kind);
    size_t n = 0;
    if (!kind)
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "this program cannot train networks of that network.kind");
    sdm_status s = SDM_ALLOC(&d, 1, "training state", err);
    if (s) return s;
    t->state = d;
    d->kind = kind;
    s = kind->create(t, &d->network, &n, err);
    if (!s) s = trainer_parameters_create(&d->weights, n, err);
    if (!s) s = SDM_ALLOC(&d->gradient, n, "gradient", err);
    if (!s) s = SDM_ALLOC(&d->slots, (size_t)t->config->train.batch, "batch", err);
    if (s) return s;
    kind->init(t, d->network, d->weights.w);
    memcpy(d->weights.average, d->weights.w, n * sizeof *d->weights.w);
    trainer_message(t, "%zu maps; %zu weights", t->data.n_static + t->data.n_start, n);
    return SDM_OK;
}

/* Updates the weights and their average. */
static void direct_update(trainer *t, direct_state *d, double rate)
{
    parameters *p = &d->weights;
    trainer_adam_update_all(p, d->gradient, trainer_adam_begin(rate, ADAM_DECAY, t->phase_step + 1),
                            trainer_threads(t));
    // the average follows the weights closely at first and then more and more slowly
    const double n = (double)t->phase_step + 1;
    trainer_average_update(
        p, t->config->train.average > 0 ? fmin(t->config->train.average, n / (n + 10)) : 0,
        trainer_threads(t));
}

/* One Adam step on a random batch. */
static sdm_status direct_step(trainer *t, direct_state *d, double rate, sdm_error *err)
{
    const direct_batch b = {
        .n = (size_t)t->config->train.batch, .slots = d->slots, .step = (uint64_t)t->step};
    for (size_t i = 0; i < b.n; i++)
        d->slots[i] = trainer_dataset_draw(&t->data, STREAM_BATCH, t->config->data.static_share,
                                           b.n, b.step, i);
    const sdm_status s =
        d->kind->gradient(t, d->network, d->weights.w, &b, d->gradient, &t->loss, err);
    if (s) return s;
    if (!isfinite(t->loss))
        return sdm_fail(
            err, SDM_E_CONFIG,
            "%s: training diverged at step %lld (loss is not a number): lower train.learning_rate",
            t->config->file, (long long)t->step);
    direct_update(t, d, rate);
    t->step++, t->phase_step++;
    return SDM_OK;
}

/* Used fraction of the budget: of the steps, or of the time that precedes the final evaluation. */
static double direct_fraction(const trainer *t, const direct_state *d)
{
    if (!trainer_by_time(t)) return trainer_fraction(t);
    const double total = t->config->train.minutes * 60,
                 // the measurement of the model, and of its error on training maps
        reserve = fmin(d->export_seconds + 2 * t->evaluation_seconds, 0.5 * total);
    const double length = total - reserve - t->phase_started;
    return length > 0 ? (trainer_shared_seconds(t) - t->phase_started) / length : 1;
}

/* Measures the averaged weights on held-out maps and adds a line to the metrics. */
static sdm_status direct_evaluate(trainer *t, direct_state *d, double rate, sdm_error *err)
{
    const double began = trainer_shared_seconds(t);
    double mse;
    const sdm_status s = d->kind->evaluate(t, d->network, d->weights.average, false, &mse, err);
    if (s) return s;
    trainer_evaluated(t, mse, began);
    return trainer_metric(t, rate, err);
}

static sdm_status direct_run(trainer *t, bool resumed, sdm_error *err)
{
    const sdm_config *c = t->config;
    direct_state *d = t->state;
    sdm_status s = resumed ? trainer_checkpoint_weights(t, err) : SDM_OK;
    if (!s && trainer_by_time(t)) s = trainer_export_time(t, &d->export_seconds, err);
    trainer_pace_start(t, (double)c->train.batch);
    if (!s && t->phase_step == 0) s = direct_evaluate(t, d, 0, err);
    for (double at; !s && (at = direct_fraction(t, d)) < 1;) {
        // new maps, or stop
        if ((s = trainer_samples_take(t, trainer_samples_wanted(t, at), err))) break;
        if (trainer_all_cancelled(t)) return trainer_stop(t, err);
        // one step
        const double rate = c->train.learning_rate * trainer_rate_schedule(at, c->train.warmup);
        if ((s = direct_step(t, d, rate, err))) break;
        // evaluate, report, save
        const double now = trainer_shared_seconds(t);
        if (trainer_evaluation_due(t, now) && (s = direct_evaluate(t, d, rate, err))) break;
        trainer_step_done(t);
        trainer_checkpoint_if_due(t, now);
    }
    if (!s && t->evaluated_step != t->step) s = direct_evaluate(t, d, 0, err);
    return s;
}

static parameters *direct_weights(trainer *t) { return &((direct_state *)t->state)->weights; }

/* Checksum over the scales of the maps made before training and over the first held-out map. */
static uint64_t direct_fingerprint(const trainer *t)
{
    const dataset *d = &t->data;
    const uint64_t crc = sdm_crc64(0, d->scale, (d->n_static + d->n_start) * sizeof *d->scale);
    return sdm_crc64(crc, d->holdout, d->n_voxels * sizeof *d->holdout);
}

static sdm_status direct_build(const trainer *t, const sdm_model_info *info, uint8_t **bytes,
                               size_t *size, sdm_error *err)
{
    const direct_state *d = t->state;
    return d->kind->build(t, d->network, d->weights.average, info, bytes, size, err);
}

static sdm_status direct_parts(const trainer *t, error_measures *out, sdm_error *err)
{
    const direct_state *d = t->state;
    const float *w = d->weights.average;
    out->other_voxels = true;
    const sdm_status s = d->kind->evaluate(t, d->network, w, true, &out->network.training, err);
    return s ? s : d->kind->evaluate(t, d->network, w, false, &out->network.heldout, err);
}

static void direct_dispose(trainer *t)
{
    direct_state *d = t->state;
    if (!d) return;
    d->kind->dispose(d->network);
    trainer_parameters_dispose(&d->weights);
    sdm_free(d->gradient);
    sdm_free(d->slots);
    sdm_free(d);
    t->state = NULL;
}

const train_kind trainer_kind_direct = {.slow = true,
                                        .block = direct_block,
                                        .begin = direct_begin,
                                        .run = direct_run,
                                        .weights = direct_weights,
                                        .fingerprint = direct_fingerprint,
                                        .build = direct_build,
                                        .parts = direct_parts,
                                        .dispose = direct_dispose};
