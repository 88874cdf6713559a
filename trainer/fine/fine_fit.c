/* The training of the fine level: samples of finished maps, Adam, a section of the model file. */
#include "fine_fit.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "data/streams.h"
#include "fine_samples.h"
#include "pod/mlp.h"
#include "sdm/internal/container.h"
#include "sdm/internal/file.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/model_threads.h"
#include "sdm/internal/near.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "state/progress.h"

/* The sizes were chosen on the cochlea (docs/notes/network.md). */
enum { SHAPES = 512, PER_SHAPE = 1024, TEST_SHAPES = 16, BATCH = 256, STEPS = 24000 };
enum { IN = SDM_FINE_INPUTS, OUT = SDM_FINE_OUTPUTS };
#define THRESHOLD 0.4f
#define RATE 4e-3
#define DECAY 0.99
#define AVERAGE 0.998

/* The network in training: the weights of an MLP, then the last matrix [OUT][width] and bias. */
typedef struct fit {
    sdm_pod_arch arch;
    size_t last; /* index of the last matrix */
    parameters w;
    float *gradient, *workspace;
    float *x, *gate, *y, *out, *dh; /* a batch */
} fit;

static sdm_status fit_create(fit *f, size_t width, sdm_error *err)
{
    enum { ALGEBRAIC = 4 };
    f->arch = (sdm_pod_arch){.n_inputs = IN, .depth = 2, .width = width, .activation = ALGEBRAIC};
    f->last = trainer_mlp_count(&f->arch);
    const size_t n = f->last + (width + 1) * OUT;
    sdm_status s = trainer_parameters_create(&f->w, n, err);
    if (!s) s = SDM_ALLOC(&f->gradient, n, "fine level", err);
    if (!s) s = SDM_ALLOC(&f->workspace, trainer_mlp_workspace(&f->arch, BATCH), "fine level", err);
    if (!s) s = SDM_ALLOC(&f->x, BATCH * (IN + 1 + 2 * OUT + width), "fine level", err);
    if (s) return s;
    f->gate = f->x + BATCH * IN;
    f->y = f->gate + BATCH;
    f->out = f->y + BATCH * OUT;
    f->dh = f->out + BATCH * OUT;
    return SDM_OK;
}

static void fit_dispose(fit *f)
{
    trainer_parameters_dispose(&f->w);
    sdm_free(f->gradient);
    sdm_free(f->workspace);
    sdm_free(f->x);
}

static void fit_start(fit *f, uint64_t seed)
{
    const size_t n = f->arch.width * OUT;
    const double deviation = sqrt(0.1 / (double)f->arch.width);
    trainer_mlp_init(&f->arch, seed, f->w.w);
    for (size_t i = 0; i < n; i++)
        f->w.w[f->last + i] = (float)(deviation * sdm_rng_normal(seed, STREAM_FINE + 2, i));
    memcpy(f->w.average, f->w.w, f->w.n * sizeof *f->w.w);
}

/* out = the outputs of the batch with weights w; returns the last hidden layer. */
static const float *fit_forward(fit *f, const float *w, int n_threads)
{
    const size_t width = f->arch.width;
    const float *h = trainer_mlp_forward(&f->arch, w, BATCH, f->x, f->workspace, n_threads);
    sdm_gemm(BATCH, OUT, width, (sdm_view){h, width, 1}, (sdm_view){w + f->last, 1, width}, false,
             f->out, OUT, n_threads);
    for (size_t i = 0; i < BATCH; i++)
        for (size_t o = 0; o < OUT; o++) f->out[i * OUT + o] += w[f->last + width * OUT + o];
    return h;
}

/* The gradient of half the mean over the batch of the sum of (gate out - y)^2; out becomes the
   gradient by the outputs. */
static void fit_backward(fit *f, const float *h, int n_threads)
{
    const size_t width = f->arch.width;
    const float *w = f->w.w;
    float *bias = f->gradient + f->last + width * OUT;
    memset(bias, 0, OUT * sizeof *bias);
    for (size_t i = 0; i < BATCH; i++)
        for (size_t o = 0; o < OUT; o++) {
            float *d = &f->out[i * OUT + o];
            *d = o ? f->gate[i] * (f->gate[i] * *d - f->y[i * OUT + o]) / BATCH : 0;
            bias[o] += *d;
        }
    sdm_gemm(OUT, width, BATCH, (sdm_view){f->out, 1, OUT}, (sdm_view){h, width, 1}, false,
             f->gradient + f->last, width, n_threads);
    sdm_gemm(BATCH, width, OUT, (sdm_view){f->out, OUT, 1}, (sdm_view){w + f->last, width, 1},
             false, f->dh, width, n_threads);
    trainer_mlp_backward(&f->arch, w, BATCH, f->x, f->workspace, f->dh, f->gradient, n_threads);
}

/* Row i of the batch = sample k. */
static void load(fit *f, const fine_samples *s, size_t i, size_t k)
{
    memcpy(f->x + i * IN, s->x + k * IN, IN * sizeof *f->x);
    memcpy(f->y + i * OUT, s->y + k * OUT, OUT * sizeof *f->y);
    f->gate[i] = s->gate[k];
}

/* trainer_seconds() at which the training must end. */
static double end_of_time(const trainer *t)
{
    return trainer_by_time(t) ? 60 * t->config->train.minutes * 0.995 : INFINITY;
}

/* Used part of the training, which began at time `began`. */
static double fraction(const trainer *t, double began, int64_t step)
{
    const double steps = (double)step / STEPS, end = end_of_time(t);
    return fmax(steps, end > began ? (trainer_seconds(t) - began) / (end - began) : 1);
}

static sdm_status fit_run(fit *f, const trainer *t, const fine_samples *s, sdm_error *err)
{
    const double began = trainer_seconds(t);
    double used = 0;
    for (int64_t step = 1; used < 1; step++) {
        if (trainer_cancelled(t)) return sdm_fail(err, SDM_E_CANCELLED, "stopped on request");
        for (size_t i = 0; i < BATCH; i++)
            load(f, s, i,
                 (size_t)sdm_rng_below(t->data.seed, STREAM_FINE + 3, (uint64_t)step * BATCH + i,
                                       s->n));
        const double rate = RATE * trainer_rate_schedule(used, 0.02);
        fit_backward(f, fit_forward(f, f->w.w, t->n_threads), t->n_threads);
        trainer_adam_update_all(&f->w, f->gradient, trainer_adam_begin(rate, DECAY, step),
                                t->n_threads);
        used = fraction(t, began, step);
        trainer_average_follow(&f->w, AVERAGE, step, used >= 1, t->n_threads);
    }
    return SDM_OK;
}

/* *out = the averaged weights in the order of sdm_fine. */
static sdm_status export_weights(const fit *f, float **out, sdm_error *err)
{
    const size_t width = f->arch.width;
    const float *w = f->w.average;
    const struct {
        size_t inputs, outputs;
        const float *matrix, *bias;
    } layers[3] = {
        {IN, width, trainer_mlp_layer(&f->arch, w, 0), trainer_mlp_bias(&f->arch, w, 0)},
        {width, width, trainer_mlp_layer(&f->arch, w, 1), trainer_mlp_bias(&f->arch, w, 1)},
        {width, OUT, w + f->last, w + f->last + width * OUT}};
    const sdm_status s = SDM_ALLOC(out, sdm_fine_count(width), "fine level", err);
    if (s) return s;
    float *to = *out;
    for (int l = 0; l < 3; l++) {
        for (size_t i = 0; i < layers[l].inputs; i++)
            for (size_t o = 0; o < layers[l].outputs; o++)
                *to++ = layers[l].matrix[o * layers[l].inputs + i];
        memcpy(to, layers[l].bias, layers[l].outputs * sizeof *to);
        to += layers[l].outputs;
    }
    return SDM_OK;
}

/* Trains the weights of a model without fine level. */
static sdm_status train(trainer *t, const sdm_model *m, size_t width, float **weights,
                        sdm_error *err)
{
    fit f = {0};
    fine_samples samples = {0};
    const double now = trainer_seconds(t), until = now + 0.5 * (end_of_time(t) - now);
    sdm_status s =
        trainer_fine_samples(t, m, NULL, THRESHOLD, 0, SHAPES, PER_SHAPE, until, &samples, err);
    if (!s) s = fit_create(&f, width, err);
    if (!s) fit_start(&f, t->data.seed);
    if (!s) s = fit_run(&f, t, &samples, err);
    if (!s) s = export_weights(&f, weights, err);
    fit_dispose(&f);
    trainer_fine_samples_dispose(&samples);
    return s;
}

/* Measures the errors of other shapes between the voxels without and with the fine level, and tells
   them. *gains: all voxels together gain. */
static sdm_status measure(trainer *t, const sdm_model *before, const sdm_fine *f, bool *gains,
                          sdm_error *err)
{
    double rmse[2][2];
    const sdm_fine *of[2] = {NULL, f};
    sdm_status s = SDM_OK;
    for (int k = 0; k < 2 && !s; k++) {
        fine_samples samples = {0};
        s = trainer_fine_samples(t, before, of[k], THRESHOLD, SHAPES, TEST_SHAPES, 0, INFINITY,
                                 &samples, err);
        for (int i = 0; i < 2; i++)
            rmse[k][i] = sqrt(samples.square[i] / fmax(samples.count[i], 1));
        trainer_fine_samples_dispose(&samples);
    }
    if (s) return s;
    *gains = rmse[1][0] < rmse[0][0];
    trainer_message(t,
                    "fine level: RMSE between the voxels %.5f -> %.5f mm, within %g mm of the "
                    "surface %.5f -> %.5f mm%s",
                    rmse[0][0], rmse[1][0], sdm_grid_near(&sdm_model_get_info(before)->grid),
                    rmse[0][1], rmse[1][1],
                    *gains ? "" : ": left out (raise train.minutes, or lower network.fine)");
    return SDM_OK;
}

sdm_status trainer_fine_add(trainer *t, sdm_error *err)
{
    const size_t width = (size_t)(t->config->network.fine + 3) / 4 * 4;
    char path[SDM_PATH_TEXT_MAX + 32];
    uint8_t *file = NULL, *bytes = NULL;
    size_t file_size, size;
    float *weights = NULL;
    sdm_model *m = NULL;
    if (!width) return SDM_OK;
    snprintf(path, sizeof path, "%s/model.sdm", t->folder);
    sdm_status s = sdm_file_read(path, SIZE_MAX, &file, &file_size, err);
    if (!s) s = sdm_model_open_memory(path, file, file_size, &m, err);
    if (!s) s = train(t, m, width, &weights, err);
    const sdm_fine fine = {.width = width, .threshold = THRESHOLD, .weights = weights};
    bool gains = false;
    if (!s) s = measure(t, m, &fine, &gains, err);
    if (!s && gains) s = sdm_fine_attach(file, file_size, &fine, &bytes, &size, err);
    if (!s && gains) s = sdm_container_write(path, bytes, size, err);
    sdm_model_free(m);
    sdm_free(bytes);
    sdm_free(weights);
    sdm_free(file);
    return s;
}
