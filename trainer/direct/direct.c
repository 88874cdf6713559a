/* Training of networks that learn by gradients on exact maps: one phase of Adam steps with warm-up
   and half a cosine, and an average of the weights. The networks: direct_network (kind.h). */
#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "export_model.h"
#include "kind.h"
#include "sdm/internal/checksum.h"
#include "sdm/memory.h"

typedef struct direct {
    const direct_network *kind;
    void *network;
    parameters weights;
    float *gradient; // [weights.n]
    size_t *slots;   // [batch]
    double export_seconds;
} direct;

static const direct_network *network_of(sdm_network_kind kind)
{
    switch (kind) {
    case SDM_NETWORK_DEEPSDF:
    case SDM_NETWORK_IMNET:
        return &point_direct;
    case SDM_NETWORK_SDMNN:
        return &sdmnn_direct;
    case SDM_NETWORK_POD:
        break;
    }
    return NULL;
}

// maps lie as [nz][ny][nx]
static size_t block(const sdm_config *c)
{
    (void)c;
    return 0;
}

static sdm_status begin(trainer *t, sdm_error *err)
{
    direct *d = NULL;
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
    if (!s) s = parameters_create(&d->weights, n, err);
    if (!s) s = SDM_ALLOC(&d->gradient, n, "gradient", err);
    if (!s) s = SDM_ALLOC(&d->slots, (size_t)t->config->train.batch, "batch", err);
    if (s) return s;
    kind->init(t, d->network, d->weights.w);
    memcpy(d->weights.average, d->weights.w, n * sizeof *d->weights.w);
    trainer_message(t, "%zu maps; %zu weights", t->data.n_static + t->data.n_start, n);
    return SDM_OK;
}

// Adam and the average, weight by weight: the same bits for any number of threads
static void update(trainer *t, direct *d, double rate)
{
    enum { SLICE = 16384 };
    const adam_step adam = adam_begin(rate, t->phase_step + 1);
    parameters *p = &d->weights;
#pragma omp parallel for schedule(static) num_threads(trainer_threads(t))
    for (long at = 0; at < (long)p->n; at += SLICE) {
        const size_t first = (size_t)at, n = p->n - first < SLICE ? p->n - first : SLICE;
        adam_update(p, first, n, d->gradient + first, adam, 1);
    }
    // the average starts with the weights themselves and lengthens its memory
    const double n = (double)t->phase_step + 1;
    average_update(p,
                   t->config->train.average > 0 ? fmin(t->config->train.average, n / (n + 10)) : 0,
                   trainer_threads(t));
}

static sdm_status step(trainer *t, direct *d, double rate, sdm_error *err)
{
    const direct_batch b = {
        .n = (size_t)t->config->train.batch, .slots = d->slots, .step = (uint64_t)t->step};
    for (size_t i = 0; i < b.n; i++)
        d->slots[i] =
            dataset_draw(&t->data, STREAM_FIT, t->config->data.static_share, b.n, b.step, i);
    const sdm_status s =
        d->kind->gradient(t, d->network, d->weights.w, &b, d->gradient, &t->loss, err);
    if (s) return s;
    if (!isfinite(t->loss))
        return sdm_fail(
            err, SDM_E_CONFIG,
            "%s: training diverged at step %lld (loss is not a number): lower train.learning_rate",
            t->config->file, (long long)t->step);
    update(t, d, rate);
    t->step++, t->phase_step++;
    return SDM_OK;
}

static double fraction_of_phase(const trainer *t, const direct *d)
{
    if (!trainer_by_time(t)) return trainer_fraction(t);
    const double total = t->config->train.minutes * 60,
                 reserve = fmin(d->export_seconds, 0.5 * total);
    const double length = total - reserve - t->phase_started;
    return length > 0 ? (trainer_seconds(t) - t->phase_started) / length : 1;
}

static sdm_status run(trainer *t, bool resumed, sdm_error *err)
{
    const sdm_config *c = t->config;
    direct *d = t->state;
    sdm_status s = resumed ? checkpoint_weights(t, err) : SDM_OK;
    if (!s && trainer_by_time(t)) s = export_time(t, &d->export_seconds, err);
    int64_t last_step = t->phase_step;
    double last_time = trainer_seconds(t);
    for (double at; !s && (at = fraction_of_phase(t, d)) < 1;) {
        const size_t all = t->data.n_start + t->data.n_online;
        const double want = (double)t->data.n_start + (double)t->data.n_online * fmin(1, at / 0.75);
        if ((s = trainer_take_samples(t, want < (double)all ? (size_t)want : all, err))) break;
        if (trainer_cancelled(t)) return trainer_stop(t, err);
        const double rate = c->train.learning_rate * schedule(at, c->train.warmup);
        if ((s = step(t, d, rate, err))) break;
        double now = trainer_seconds(t);
        if (trainer_by_time(t) ? now - t->last_evaluation >= c->train.evaluate_seconds
                               : t->phase_step % 500 == 0) {
            if ((s = d->kind->evaluate(t, d->network, d->weights.average, &t->heldout_mse, err)))
                break;
            t->last_evaluation = now = trainer_seconds(t);
            if ((s = trainer_metric(t, rate, err))) break;
        }
        if (now - last_time > 0.5) {
            trainer_report(t, trainer_fraction(t),
                           (double)(t->phase_step - last_step) * (double)c->train.batch /
                               (now - last_time),
                           true);
            last_step = t->phase_step, last_time = now;
        }
        if (now - t->last_checkpoint > c->train.checkpoint_seconds) s = checkpoint_write(t, err);
    }
    return s;
}

static parameters *weights(trainer *t) { return &((direct *)t->state)->weights; }

// of the maps before training and the first of the held-out ones
static uint64_t fingerprint(const trainer *t)
{
    const dataset *d = &t->data;
    const uint64_t crc = sdm_crc64(0, d->scale, (d->n_static + d->n_start) * sizeof *d->scale);
    return sdm_crc64(crc, d->holdout, d->n_voxels * sizeof *d->holdout);
}

static sdm_status build(const trainer *t, const sdm_model_info *info, uint8_t **bytes, size_t *size,
                        sdm_error *err)
{
    const direct *d = t->state;
    return d->kind->build(t, d->network, d->weights.average, info, bytes, size, err);
}

static void dispose(trainer *t)
{
    direct *d = t->state;
    if (!d) return;
    d->kind->dispose(d->network);
    parameters_dispose(&d->weights);
    sdm_free(d->gradient);
    sdm_free(d->slots);
    sdm_free(d);
    t->state = NULL;
}

const train_kind direct_train = {.block = block,
                                 .begin = begin,
                                 .run = run,
                                 .weights = weights,
                                 .fingerprint = fingerprint,
                                 .build = build,
                                 .dispose = dispose};
