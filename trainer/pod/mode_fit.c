/* Fits the MLP to the mode coefficients. B is the size of a batch; other letters as in
 * pod_state.h. */
#include "mode_fit.h"

#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "mlp.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/team.h"
#include "sdm/memory.h"
#include "state/best.h"
#include "state/checkpoint.h"
#include "state/new_samples.h"
#include "state/progress.h"

/* Decay of Adam's second moments. In one trial on the cochlea (3,000 steps, rate 3e-3) 0.99 left 7
   % less error beyond that of the bases than 0.999. */
#define MODE_FIT_DECAY 0.99

/* Memory of a batch. */
typedef struct mode_batch {
    float *x;         // [B][I]
    float *target;    // [B][R]
    float *predicted; // [B][R], later the gradient by it
    float *dh;        // [B][W]
    double *loss;     // [B] sums of squared errors
    float *workspace;
    float *gradient; // [n]
} mode_batch;

static void mode_batch_dispose(mode_batch *b)
{
    sdm_free(b->x);
    sdm_free(b->target);
    sdm_free(b->predicted);
    sdm_free(b->dh);
    sdm_free(b->loss);
    sdm_free(b->workspace);
    sdm_free(b->gradient);
}

static sdm_status mode_batch_create(const pod_state *pod, size_t rows, mode_batch *b,
                                    sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    sdm_status s = SDM_ALLOC(&b->x, rows * a->n_inputs, "batch", err);
    if (!s) s = SDM_ALLOC(&b->target, rows * pod->n_modes, "batch", err);
    if (!s) s = SDM_ALLOC(&b->predicted, rows * pod->n_modes, "batch", err);
    if (!s) s = SDM_ALLOC(&b->dh, rows * a->width, "batch", err);
    if (!s) s = SDM_ALLOC(&b->loss, rows, "batch", err);
    if (!s) s = SDM_ALLOC(&b->workspace, trainer_mlp_workspace(a, rows), "batch", err);
    if (!s) s = SDM_ALLOC(&b->gradient, pod->mode_fit.n, "gradient", err);
    return s;
}

/* predicted[B][R] = MLP and readout at x with weights w, in some rows. Returns h[B][W], the output
 * of the MLP. */
static const float *predict_rows(const pod_state *pod, const float *w, size_t batch,
                                 sdm_comm_part rows, mode_batch *b)
{
    const sdm_pod_arch *a = &pod->arch;
    const int threads = trainer_threads(pod->t);
    const float *h = trainer_mlp_forward_rows(a, w, batch, rows, b->x, b->workspace, threads);
    sdm_gemm(rows.end - rows.first, pod->n_modes, a->width,
             (sdm_view){h + rows.first * a->width, a->width, 1},
             (sdm_view){w + trainer_mlp_count(a), 1, a->width}, false,
             b->predicted + rows.first * pod->n_modes, pod->n_modes, threads);
    return h;
}

/* The same in all rows. */
static void modes_predict(const pod_state *pod, const float *w, size_t batch, mode_batch *b)
{
    predict_rows(pod, w, batch, (sdm_comm_part){0, batch}, b);
}

/* Mean square error (mm^2) on the held-out maps: the error of the mode coefficients plus the error
 * that remains with exact mode coefficients. */
static double modes_evaluate(const pod_state *pod, const float *w, mode_batch *b, size_t batch)
{
    const size_t n = pod->t->data.n_holdout, r = pod->n_modes, inputs = pod->arch.n_inputs;
    double sum = 0;
    for (size_t at = 0; at < n; at += batch) {
        const size_t rows = n - at < batch ? n - at : batch;
        for (size_t i = 0; i < rows; i++)
            memcpy(b->x + i * inputs, pod->holdout_phi + (at + i) * pod->n_poly + 1,
                   inputs * sizeof *b->x);
        modes_predict(pod, w, rows, b);
        for (size_t i = 0; i < rows * r; i++) {
            const double e = (double)b->predicted[i] - pod->holdout_target[at * r + i];
            sum += e * e;
        }
    }
    const double scale = pod->target_scale;
    return pod->holdout_floor + sum * scale * scale / ((double)n * (double)pod->t->data.n_voxels);
}

sdm_status trainer_mode_fit_errors(const pod_state *pod, const size_t *slots, size_t n,
                                   double *error, sdm_error *err)
{
    const size_t r = pod->n_modes, inputs = pod->arch.n_inputs;
    mode_batch b = {0};
    const sdm_status s = mode_batch_create(pod, n, &b, err);
    for (size_t i = 0; i < n && !s; i++)
        memcpy(b.x + i * inputs, pod->phi + slots[i] * pod->n_poly + 1, inputs * sizeof *b.x);
    if (!s) modes_predict(pod, pod->mode_fit.average, n, &b);
    for (size_t i = 0; i < n && !s; i++) {
        double sum = 0;
        for (size_t j = 0; j < r; j++) {
            const double e = (double)b.predicted[i * r + j] - pod->target[slots[i] * r + j];
            sum += e * e;
        }
        error[i] = pod->target_scale * sqrt(sum / (double)pod->t->data.n_voxels);
    }
    mode_batch_dispose(&b);
    return s;
}

/* A loop over the rows of a batch. */
typedef struct mode_loop {
    const pod_state *pod;
    mode_batch *batch;
    size_t rows;
    sdm_comm_part own; // rows of this rank
} mode_loop;

/* Rows of a batch that a thread computes at a time. */
enum { ROWS = 8 };

/* Draws the maps of the rows index * ROWS and up: copies their inputs and targets. */
static void draw_rows(void *user, size_t index, int member)
{
    const mode_loop *l = user;
    const pod_state *pod = l->pod;
    mode_batch *b = l->batch;
    const size_t r = pod->n_modes, inputs = pod->arch.n_inputs;
    (void)member;
    for (size_t i = index * ROWS; i < index * ROWS + ROWS && i < l->rows; i++) {
        const size_t slot =
            trainer_dataset_draw(&pod->t->data, STREAM_BATCH, pod->t->config->data.static_share,
                                 l->rows, (uint64_t)pod->t->step, i);
        memcpy(b->x + i * inputs, pod->phi + slot * pod->n_poly + 1, inputs * sizeof *b->x);
        memcpy(b->target + i * r, pod->target + slot * r, r * sizeof *b->target);
    }
}

/* Loss, and its gradient with respect to the predictions, in the rows index * ROWS of this rank and
 * up. */
static void compare_rows(void *user, size_t index, int member)
{
    const mode_loop *l = user;
    mode_batch *b = l->batch;
    const size_t r = l->pod->n_modes;
    const size_t first = l->own.first + index * ROWS;
    (void)member;
    for (size_t i = first; i < first + ROWS && i < l->own.end; i++) {
        double sum = 0;
        for (size_t j = i * r; j < (i + 1) * r; j++) {
            const float e = b->predicted[j] - b->target[j];
            sum += (double)e * e;
            b->predicted[j] = e * (2.0f / (float)l->rows);
        }
        b->loss[i] = sum;
    }
}

/* Gives all ranks the rows of the batch that the others have computed. */
static sdm_status gather_rows(const pod_state *pod, mode_batch *b, size_t batch, sdm_error *err)
{
    sdm_comm *comm = pod->t->hooks.comm;
    sdm_status s = sdm_comm_gather_shares(comm, b->loss, batch, sizeof *b->loss, err);
    if (!s)
        s = sdm_comm_gather_shares(comm, b->predicted, batch, pod->n_modes * sizeof *b->predicted,
                                   err);
    return s ? s : trainer_mlp_gather_rows(&pod->arch, comm, batch, b->workspace, err);
}

/* b->gradient = gradient with respect to the weights: each rank computes that of some modes and of
 * some units of each layer. h[B][W]: output of the MLP. */
static sdm_status weight_gradient(const pod_state *pod, mode_batch *b, size_t batch, const float *h,
                                  sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    sdm_comm *comm = pod->t->hooks.comm;
    const size_t r = pod->n_modes;
    const int threads = trainer_threads(pod->t);
    const sdm_comm_part modes = sdm_comm_own(comm, r);
    float *readout = b->gradient + trainer_mlp_count(a);
    sdm_gemm(modes.end - modes.first, a->width, batch, (sdm_view){b->predicted + modes.first, 1, r},
             (sdm_view){h, a->width, 1}, false, readout + modes.first * a->width, a->width,
             threads);
    trainer_mlp_gradient_units(a, batch, sdm_comm_own(comm, a->width), b->x, b->workspace,
                               b->gradient, threads);
    const sdm_status s = sdm_comm_gather_shares(comm, readout, r, a->width * sizeof *readout, err);
    return s ? s : trainer_mlp_gather_units(a, comm, b->gradient, err);
}

/* One Adam step on a random batch. */
static sdm_status mode_fit_step(pod_state *pod, mode_batch *b, size_t batch, double rate,
                                sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    const sdm_comm_part own = sdm_comm_own(pod->t->hooks.comm, batch);
    const size_t r = pod->n_modes, n = own.end - own.first, readout = trainer_mlp_count(a);
    const int threads = trainer_threads(pod->t);
    mode_loop loop = {pod, b, batch, own};
    sdm_team_run(threads, (batch + ROWS - 1) / ROWS, draw_rows, &loop);
    // forward and backward pass in the rows of this rank
    const float *h = predict_rows(pod, pod->mode_fit.w, batch, own, b);
    sdm_team_run(threads, (n + ROWS - 1) / ROWS, compare_rows, &loop);
    sdm_gemm(n, a->width, r, (sdm_view){b->predicted + own.first * r, r, 1},
             (sdm_view){pod->mode_fit.w + readout, a->width, 1}, false,
             b->dh + own.first * a->width, a->width, threads);
    trainer_mlp_backward_rows(a, pod->mode_fit.w, batch, own, b->workspace, b->dh, threads);

    sdm_status s = gather_rows(pod, b, batch, err);
    if (!s) s = weight_gradient(pod, b, batch, h, err);
    if (s) return s;
    trainer_adam_update_all(&pod->mode_fit, b->gradient,
                            trainer_adam_begin(rate, MODE_FIT_DECAY, pod->t->phase_step + 1),
                            threads);
    double sum = 0;
    for (size_t i = 0; i < batch; i++) sum += b->loss[i];
    const double scale = pod->target_scale;
    pod->t->loss =
        pod->training_floor + sum * scale * scale / ((double)batch * (double)pod->t->data.n_voxels);
    return SDM_OK;
}

/* Used fraction of the phase's budget, which is (1 - train.refine) * (number of steps), at least
 * one step, or the time until mode_fit_end. */
static double mode_fit_fraction(const pod_state *pod)
{
    const trainer *t = pod->t;
    if (!trainer_by_time(t)) {
        const double steps = floor((1 - t->config->train.refine) * (double)trainer_steps(t) + 0.5);
        return (double)t->phase_step / fmax(steps, 1);
    }
    const double length = pod->mode_fit_end - t->phase_started;
    return length > 0 ? (trainer_shared_seconds(t) - t->phase_started) / length : 1;
}

/* Measures the averaged weights on the held-out maps and adds a line to the metrics. */
static sdm_status evaluate(pod_state *pod, mode_batch *b, size_t batch, double rate, sdm_error *err)
{
    const double began = trainer_shared_seconds(pod->t);
    trainer_evaluated(pod->t, modes_evaluate(pod, pod->mode_fit.average, b, batch), began);
    return trainer_metric(pod->t, rate, err);
}

sdm_status trainer_mode_fit_run(pod_state *pod, sdm_error *err)
{
    trainer *t = pod->t;
    const sdm_config *c = t->config;
    if (!pod->arch.depth) return SDM_OK;
    const size_t batch = (size_t)c->train.batch;
    mode_batch b = {0};
    sdm_status s = mode_batch_create(pod, batch, &b, err);
    double at = mode_fit_fraction(pod);
    bool done = false;
    trainer_pace_start(t, (double)batch);
    if (!s && t->phase_step == 0) s = evaluate(pod, &b, batch, 0, err);
    while (!s && at < 1 && !done) {
        // new maps, or stop
        if ((s = trainer_samples_take(t, trainer_samples_wanted(t, at), err))) break;
        if (trainer_all_cancelled(t)) {
            s = trainer_stop(t, err);
            break;
        }
        // one step
        const double rate = c->train.learning_rate * trainer_rate_schedule(at, c->train.warmup);
        if ((s = mode_fit_step(pod, &b, batch, rate, err))) break;
        t->step++, t->phase_step++;
        at = mode_fit_fraction(pod);
        trainer_average_follow(&pod->mode_fit, c->train.average, t->phase_step, !(at < 1),
                               trainer_threads(t));
        if (!isfinite(t->loss)) {
            s = sdm_fail(err, SDM_E_CONFIG,
                         "%s: training diverged at step %lld (loss is not a number): lower "
                         "train.learning_rate",
                         c->file, (long long)t->step);
            break;
        }
        // evaluate, report, save
        const double now = trainer_shared_seconds(t);
        if (trainer_evaluation_due(t, now)) {
            if ((s = evaluate(pod, &b, batch, rate, err))) break;
            if (trainer_evaluation_counts(t))
                done = trainer_best_note(t, &pod->mode_fit, at, t->heldout_mse);
        }
        trainer_step_done(t);
        trainer_checkpoint_if_due(t, now);
    }
    if (!s && t->evaluated_step != t->step) s = evaluate(pod, &b, batch, 0, err);
    if (!s) {
        trainer_best_note(t, &pod->mode_fit, at, t->heldout_mse);
        trainer_best_restore(t, &pod->mode_fit);
    }
    if (!s && done) trainer_ended_early(t, at);
    mode_batch_dispose(&b);
    return s;
}
