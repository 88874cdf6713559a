/* Fitting of the MLP to the coefficients of the global modes: cheap steps, since no map is touched.
   For orthonormal bases the error of the coefficients is the error of the map. Letters as in
   sdm/pod.h; R modes, B batch. */
#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "mlp.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "trainer.h"

typedef struct fit_batch {
    float *x;         // [B][I]
    float *target;    // [B][R]
    float *predicted; // [B][R], then its gradient
    float *dh;        // [B][W]
    float *workspace;
    float *gradient; // [n]
} fit_batch;

static void fit_dispose(fit_batch *b)
{
    sdm_free(b->x);
    sdm_free(b->target);
    sdm_free(b->predicted);
    sdm_free(b->dh);
    sdm_free(b->workspace);
    sdm_free(b->gradient);
}

static sdm_status fit_create(const trainer *t, size_t rows, fit_batch *b, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    sdm_status s = SDM_ALLOC(&b->x, rows * a->n_inputs, "batch", err);
    if (!s) s = SDM_ALLOC(&b->target, rows * t->n_modes, "batch", err);
    if (!s) s = SDM_ALLOC(&b->predicted, rows * t->n_modes, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dh, rows * a->width, "batch", err);
    if (!s) s = SDM_ALLOC(&b->workspace, mlp_workspace(a, rows), "batch", err);
    if (!s) s = SDM_ALLOC(&b->gradient, t->fit.n, "gradient", err);
    return s;
}

// predicted[B][R] from x with weights w
static const float *predict(const trainer *t, const float *w, size_t rows, fit_batch *b)
{
    const sdm_pod_arch *a = &t->arch;
    const float *h = mlp_forward(a, w, rows, b->x, b->workspace, trainer_threads(t));
    sdm_gemm(rows, t->n_modes, a->width, (sdm_view){h, a->width, 1},
             (sdm_view){w + mlp_count(a), 1, a->width}, false, b->predicted, t->n_modes,
             trainer_threads(t));
    return h;
}

// mean square error of the maps, mm^2, by the error of the modes and what lies outside them
static double evaluate(const trainer *t, const float *w, fit_batch *b, size_t batch)
{
    const size_t n = t->data.n_holdout, r = t->n_modes, inputs = t->arch.n_inputs;
    double sum = 0;
    for (size_t at = 0; at < n; at += batch) {
        const size_t rows = n - at < batch ? n - at : batch;
        for (size_t i = 0; i < rows; i++)
            memcpy(b->x + i * inputs, t->holdout_phi + (at + i) * t->n_poly + 1,
                   inputs * sizeof *b->x);
        predict(t, w, rows, b);
        for (size_t i = 0; i < rows * r; i++) {
            const double e = (double)b->predicted[i] - t->holdout_target[at * r + i];
            sum += e * e;
        }
    }
    const double scale = t->target_scale;
    return t->holdout_floor + sum * scale * scale / ((double)n * (double)t->data.n_voxels);
}

sdm_status fit_errors(const trainer *t, const size_t *slots, size_t n, double *error,
                      sdm_error *err)
{
    const size_t r = t->n_modes, inputs = t->arch.n_inputs;
    fit_batch b = {0};
    const sdm_status s = fit_create(t, n, &b, err);
    for (size_t i = 0; i < n && !s; i++)
        memcpy(b.x + i * inputs, t->phi + slots[i] * t->n_poly + 1, inputs * sizeof *b.x);
    if (!s) predict(t, t->fit.average, n, &b);
    for (size_t i = 0; i < n && !s; i++) {
        double sum = 0;
        for (size_t j = 0; j < r; j++) {
            const double e = (double)b.predicted[i * r + j] - t->target[slots[i] * r + j];
            sum += e * e;
        }
        error[i] = t->target_scale * sqrt(sum / (double)t->data.n_voxels);
    }
    fit_dispose(&b);
    return s;
}

static void step(trainer *t, fit_batch *b, size_t batch, double rate)
{
    const sdm_pod_arch *a = &t->arch;
    const size_t r = t->n_modes, readout = mlp_count(a);
    const double share = t->config->data.static_share;
    for (size_t i = 0; i < batch; i++) {
        const size_t slot = dataset_draw(&t->data, STREAM_FIT, share, batch, (uint64_t)t->step, i);
        memcpy(b->x + i * a->n_inputs, t->phi + slot * t->n_poly + 1, a->n_inputs * sizeof *b->x);
        memcpy(b->target + i * r, t->target + slot * r, r * sizeof *b->target);
    }
    const float *h = predict(t, t->fit.w, batch, b);
    double sum = 0;
    for (size_t i = 0; i < batch * r; i++) {
        const float e = b->predicted[i] - b->target[i];
        sum += (double)e * e;
        b->predicted[i] = e * (2.0f / (float)batch);
    }
    const double scale = t->target_scale;
    t->loss = t->holdout_floor + sum * scale * scale / ((double)batch * (double)t->data.n_voxels);

    const int threads = trainer_threads(t);
    sdm_gemm(r, a->width, batch, (sdm_view){b->predicted, 1, r}, (sdm_view){h, a->width, 1}, false,
             b->gradient + readout, a->width, threads);
    sdm_gemm(batch, a->width, r, (sdm_view){b->predicted, r, 1},
             (sdm_view){t->fit.w + readout, a->width, 1}, false, b->dh, a->width, threads);
    mlp_backward(a, t->fit.w, batch, b->x, b->workspace, b->dh, b->gradient, threads);
    adam_update(&t->fit, 0, t->fit.n, b->gradient, adam_begin(rate, t->phase_step + 1), 1);
    if (t->config->train.average > 0) {
        // the average starts with the weights themselves and lengthens its memory
        const double n = (double)t->phase_step + 1,
                     decay = fmin(t->config->train.average, n / (n + 10));
        average_update(&t->fit, decay, 1);
    } else
        memcpy(t->fit.average, t->fit.w, t->fit.n * sizeof *t->fit.w);
}

static double fraction_of_phase(const trainer *t)
{
    if (!trainer_by_time(t)) return (double)t->phase_step / (double)trainer_fit_steps(t);
    const double length = t->fit_end - t->phase_started;
    return length > 0 ? (trainer_seconds(t) - t->phase_started) / length : 1;
}

sdm_status fit_run(trainer *t, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    const sdm_config *c = t->config;
    if (!a->depth) return SDM_OK;
    const size_t batch = (size_t)c->train.batch;
    fit_batch b = {0};
    sdm_status s = fit_create(t, batch, &b, err);
    int64_t last_step = t->phase_step;
    double last_time = trainer_seconds(t);
    for (double at; !s && (at = fraction_of_phase(t)) < 1;) {
        const size_t n_random = t->data.n_start + t->data.n_online;
        const double want = (double)t->data.n_start + (double)t->data.n_online * fmin(1, at / 0.75);
        if ((s = trainer_take_samples(t, want < (double)n_random ? (size_t)want : n_random, err)))
            break;
        if (trainer_cancelled(t)) {
            s = trainer_stop(t, err);
            break;
        }
        const double rate = c->train.learning_rate * schedule(at, c->train.warmup);
        step(t, &b, batch, rate);
        t->step++, t->phase_step++;
        if (!isfinite(t->loss)) {
            s = sdm_fail(err, SDM_E_CONFIG,
                         "%s: training diverged at step %lld (loss is not a number): lower "
                         "train.learning_rate",
                         c->file, (long long)t->step);
            break;
        }
        const double now = trainer_seconds(t);
        if (trainer_by_time(t) ? now - t->last_evaluation >= c->train.evaluate_seconds
                               : t->phase_step % 500 == 0) {
            t->heldout_mse = evaluate(t, t->fit.average, &b, batch);
            t->last_evaluation = now;
            if ((s = trainer_metric(t, rate, err))) break;
        }
        if (now - last_time > 0.5) {
            trainer_report(t, trainer_fraction(t),
                           (double)(t->phase_step - last_step) * (double)batch / (now - last_time),
                           true);
            last_step = t->phase_step, last_time = now;
        }
        if (now - t->last_checkpoint > c->train.checkpoint_seconds) s = checkpoint_write(t, err);
    }
    if (!s) t->heldout_mse = evaluate(t, t->fit.average, &b, batch);
    fit_dispose(&b);
    return s;
}
