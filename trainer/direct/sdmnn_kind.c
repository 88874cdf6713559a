/* The sdmnn network in the trainer: it learns from whole maps, one after another. */
#include <string.h>

#include "data/streams.h"
#include "direct_network.h"
#include "numerics/loss.h"
#include "sdm/internal/sdmnn.h"
#include "sdm/memory.h"
#include "state/progress.h"

enum { EVALUATED = 16 }; // held-out maps in an evaluation during training

typedef struct sdmnn_trainer {
    sdm_sdmnn_arch arch;
    sdm_sdmnn *net;
    float *x;      // [batch][P] scaled parameters
    float *target; // [V] exact map
    float *value;  // [V] map of the network
    // state of the batch for sdmnn_map_loss()
    const trainer *t;
    const direct_batch *batch;
    double square; // sum of squared errors, mm^2
} sdmnn_trainer;

/* The convolutions of oneDNN if the build has oneDNN, else those of this library. */
static const sdm_conv_backend *conv_backend(void)
{
#ifdef SDM_HAVE_DNNL
    return sdm_conv_dnnl();
#else
    return sdm_conv_native();
#endif
}

static sdm_status sdmnn_create(const trainer *t, void **network, size_t *n_weights, sdm_error *err)
{
    const sdm_config *c = t->config;
    sdmnn_trainer *p = NULL;
    sdm_status s = SDM_ALLOC(&p, 1, "network", err);
    if (s) return s;
    *network = p;
    p->arch = (sdm_sdmnn_arch){.n_params = t->data.n_params,
                               .depth = (size_t)c->network.depth,
                               .channels = (size_t)c->network.channels,
                               .width = (size_t)c->network.width,
                               .block = (size_t)c->network.block,
                               .activation = (int)c->network.activation,
                               .dropout = c->network.dropout};
    for (int i = 0; i < 3; i++) p->arch.n[i] = (size_t)c->grid.n[i];
    if (sdm_sdmnn_check(&p->arch, err))
        return sdm_fail_in(err, SDM_E_CONFIG, "%s: network", c->file);
    const size_t batch = (size_t)c->train.batch;
    s = sdm_sdmnn_create(&p->arch, batch, conv_backend(), &p->net, err);
    if (!s) s = SDM_ALLOC(&p->x, batch * p->arch.n_params, "batch", err);
    if (!s) s = SDM_ALLOC(&p->target, t->data.n_voxels, "batch", err);
    if (!s) s = SDM_ALLOC(&p->value, t->data.n_voxels, "batch", err);
    if (!s) *n_weights = sdm_sdmnn_count(&p->arch);
    return s;
}

static void sdmnn_dispose(void *network)
{
    sdmnn_trainer *p = network;
    if (!p) return;
    sdm_sdmnn_free(p->net);
    sdm_free(p->x);
    sdm_free(p->target);
    sdm_free(p->value);
    sdm_free(p);
}

/* map[V] = the mean of the maps made before training. */
static void mean_map(const dataset *d, float *map)
{
    const size_t n = d->n_static + d->n_start;
    memset(map, 0, d->n_voxels * sizeof *map);
    for (size_t i = 0; i < n; i++) {
        const float share = d->scale[i] / (float)n;
        const int16_t *from = trainer_dataset_values(d, i, 0);
        for (size_t v = 0; v < d->n_voxels; v++) map[v] += share * (float)from[v];
    }
}

static void sdmnn_init(const trainer *t, const void *network, float *w)
{
    const sdmnn_trainer *p = network;
    mean_map(&t->data, p->target);
    sdm_sdmnn_init(&p->arch, p->target, t->config->seed, STREAM_INIT, w);
}

static void scale_params(const dataset *d, const double *params, float *x)
{
    for (size_t k = 0; k < d->n_params; k++)
        x[k] = (float)(2 * (params[k] - d->min[k]) / (d->max[k] - d->min[k]) - 1);
}

/* map[n_voxels] = the map in `slot`, mm. */
static void unpack(const dataset *d, size_t slot, float *map)
{
    const int16_t *from = trainer_dataset_values(d, slot, 0);
    for (size_t v = 0; v < d->n_voxels; v++) map[v] = d->scale[slot] * (float)from[v];
}

/* Callback of sdm_sdmnn_gradient(): dvalues = derivative of the batch's loss by the values of map
   `index`. */
static double sdmnn_map_loss(void *user, size_t index, const float *values, float *dvalues)
{
    sdmnn_trainer *p = user;
    const dataset *d = &p->t->data;
    const size_t slot = p->batch->slots[index];
    const float share = 1.0f / (float)p->batch->n;
    unpack(d, slot, p->target);
    p->square += trainer_loss_map(p->t->config, values, p->target, dvalues);
    for (size_t v = 0; v < d->n_voxels; v++) dvalues[v] *= share;
    return 0;
}

static sdm_status sdmnn_gradient(const trainer *t, void *network, const float *w,
                                 const direct_batch *b, float *out, double *mse, sdm_error *err)
{
    sdmnn_trainer *p = network;
    const dataset *d = &t->data;
    (void)err;
    p->t = t, p->batch = b, p->square = 0;
    for (size_t i = 0; i < b->n; i++)
        scale_params(d, d->params + b->slots[i] * d->n_params, p->x + i * d->n_params);
    sdm_sdmnn_set(p->net, w);
    sdm_sdmnn_gradient(p->net, b->n, p->x, sdmnn_map_loss, p, t->config->seed, STREAM_DROPOUT,
                       b->step * b->n, out, trainer_threads(t));
    *mse = p->square / ((double)b->n * (double)d->n_voxels);
    return SDM_OK;
}

static sdm_status sdmnn_evaluate(const trainer *t, void *network, const float *w, bool training,
                                 double *mse, sdm_error *err)
{
    sdmnn_trainer *p = network;
    const dataset *d = &t->data;
    const size_t all = training ? trainer_dataset_measured(d) : d->n_holdout,
                 n = all < EVALUATED ? all : EVALUATED;
    double square = 0;
    (void)err;
    sdm_sdmnn_set(p->net, w);
    for (size_t i = 0; i < n; i++) {
        const float *exact = d->holdout + i * d->n_voxels;
        const double *params = d->holdout_params + i * d->n_params;
        if (training) {
            const size_t slot = trainer_dataset_measured_slot(d, i);
            unpack(d, slot, p->target);
            exact = p->target, params = d->params + slot * d->n_params;
        }
        scale_params(d, params, p->x);
        sdm_sdmnn_forward(p->net, p->x, p->value, trainer_threads(t));
        for (size_t v = 0; v < d->n_voxels; v++) {
            const double e = (double)p->value[v] - (double)exact[v];
            square += e * e;
        }
    }
    *mse = square / ((double)n * (double)d->n_voxels);
    return SDM_OK;
}

static sdm_status sdmnn_build(const trainer *t, const void *network, const float *w,
                              const sdm_model_info *info, uint8_t **bytes, size_t *size,
                              sdm_error *err)
{
    const sdm_sdmnn_spec spec = {.info = info,
                                 .arch = ((const sdmnn_trainer *)network)->arch,
                                 .weights = w,
                                 .half = t->config->network.weights == SDM_WEIGHT_F16};
    return sdm_sdmnn_build(&spec, bytes, size, err);
}

const direct_network trainer_network_sdmnn = {.create = sdmnn_create,
                                              .dispose = sdmnn_dispose,
                                              .init = sdmnn_init,
                                              .gradient = sdmnn_gradient,
                                              .evaluate = sdmnn_evaluate,
                                              .build = sdmnn_build};
