/* The pod network in the trainer: its design, its phases, its model file. */
#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "kind.h"
#include "mlp.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

int64_t trainer_fit_steps(const trainer *t)
{
    const int64_t n = (int64_t)((1 - t->config->train.refine) * (double)trainer_steps(t) + 0.5);
    return n > 0 ? n : 1;
}

static size_t block(const sdm_config *c) { return (size_t)c->network.block; }

static size_t levels(const sdm_config *c) { return (size_t)c->network.levels; }

// the largest degree that the number of maps can determine
static size_t affordable(size_t n_params, size_t degree, size_t terms)
{
    while (degree > 0 && sdm_poly_count(n_params, degree) > terms) degree--;
    return degree;
}

// the network that the number of maps made so far can determine
static sdm_status design(trainer *t, sdm_error *err)
{
    const sdm_config *c = t->config;
    sdm_pod_arch *a = &t->arch;
    const dataset *d = &t->data;
    a->n_params = d->n_params;
    a->n_voxels = d->n_voxels;
    a->levels = t->levels;
    a->block = (size_t)c->network.block;
    a->degree =
        affordable(a->n_params, (size_t)c->network.degree, (d->n_static + d->n_start) / 4 + 1);
    if (a->degree < (size_t)c->network.degree)
        trainer_message(t,
                        "network.degree lowered from %d to %zu: %zu maps before training cannot "
                        "determine more terms",
                        c->network.degree, a->degree, d->n_static + d->n_start);
    a->input_degree = affordable(a->n_params, (size_t)c->network.input_degree, 1024);
    if (a->input_degree < 1) a->input_degree = 1;
    if (a->input_degree < (size_t)c->network.input_degree)
        trainer_message(t, "network.input_degree lowered from %d to %zu: more than 1023 inputs",
                        c->network.input_degree, a->input_degree);
    a->depth = (size_t)c->network.depth;
    a->width = (size_t)c->network.width;
    a->activation = (int)c->network.activation;
    a->n_terms = sdm_poly_count(a->n_params, a->degree);
    a->n_inputs = sdm_poly_count(a->n_params, a->input_degree) - 1;
    a->n_latent = a->n_terms + (a->depth ? a->width : 0);
    t->n_poly = a->n_terms > a->n_inputs + 1 ? a->n_terms : a->n_inputs + 1;
    const sdm_status s = SDM_ALLOC(&t->exponents, t->n_poly * a->n_params, "polynomials", err);
    if (s) return s;
    sdm_poly_table(a->n_params, a->degree > a->input_degree ? a->degree : a->input_degree,
                   t->exponents);
    return SDM_OK;
}

static sdm_status start_fit(trainer *t, sdm_error *err)
{
    const sdm_pod_arch *a = &t->arch;
    const size_t mlp = mlp_count(a);
    const sdm_status s = parameters_create(&t->fit, mlp + t->n_modes * a->width, err);
    if (s) return s;
    mlp_init(a, t->config->seed, t->fit.w);
    for (size_t i = mlp; i < t->fit.n; i++)
        t->fit.w[i] =
            (float)(0.3 / sqrt((double)a->width) * sdm_rng_normal(t->config->seed, STREAM_INIT, i));
    memcpy(t->fit.average, t->fit.w, t->fit.n * sizeof *t->fit.w);
    return SDM_OK;
}

static size_t decoder_weights(const trainer *t)
{
    const sdm_pod_arch *a = &t->arch;
    return a->n_coefficients * a->n_latent + t->matrix_at[a->levels.first[a->levels.n]];
}

static sdm_status begin(trainer *t, sdm_error *err)
{
    sdm_status s = design(t, err);
    if (!s) s = bases_make(t, err);
    if (s) return s;
    trainer_message(t,
                    "%zu maps; a decoder of %.3g million weights; bases and %zu modes leave %.2g "
                    "mm^2 on held-out shapes",
                    t->data.n_static + t->data.n_start, 1e-6 * (double)decoder_weights(t),
                    t->n_modes, t->holdout_floor);
    return start_fit(t, err);
}

static sdm_status run(trainer *t, bool resumed, sdm_error *err)
{
    sdm_status s = SDM_OK;
    const double total = t->config->train.minutes * 60;
    t->fit_end = t->phase_started + (total - t->phase_started) * (1 - t->config->train.refine);
    if (t->phase == SDM_PHASE_FIT) {
        if (resumed) s = checkpoint_weights(t, err);
        if (!s) s = fit_run(t, err);
        if (!s) s = refine_start(t, false, err);
        if (!s) s = refine_evaluate(t, t->refine.w, &t->heldout_mse, err);
        if (s) return s;
        trainer_enter(t, SDM_PHASE_REFINE);
        if ((s = trainer_metric(t, 0, err))) return s;
    } else {
        s = refine_start(t, true, err);
        if (!s) s = checkpoint_weights(t, err);
    }
    if (!s) s = refine_run(t, err);
    return s;
}

static parameters *weights(trainer *t) { return t->phase == SDM_PHASE_FIT ? &t->fit : &t->refine; }

// of mean, bases, modes and ranks
static uint64_t fingerprint(const trainer *t)
{
    const sdm_pod_arch *a = &t->arch;
    const size_t n_blocks = a->levels.first[a->levels.n], basis = t->matrix_at[n_blocks];
    uint64_t crc = 0;
    for (size_t b = 0; b < n_blocks; b++)
        crc = sdm_crc64(crc, &t->blocks[b].rank, sizeof t->blocks[b].rank);
    crc = sdm_crc64(crc, t->mean, a->n_voxels * sizeof *t->mean);
    crc = sdm_crc64(crc, t->basis, basis * sizeof *t->basis);
    return sdm_crc64(crc, t->modes, t->n_modes * a->n_coefficients * sizeof *t->modes);
}

static sdm_status build(const trainer *t, const sdm_model_info *info, uint8_t **bytes, size_t *size,
                        sdm_error *err)
{
    const float *w = t->refine.average;
    sdm_pod_spec spec = {
        .info = info,
        .arch = t->arch,
        .blocks = t->blocks,
        .type = t->config->network.weights == SDM_WEIGHT_I8    ? SDM_POD_I8
                : t->config->network.weights == SDM_WEIGHT_F16 ? SDM_POD_F16
                                                               : SDM_POD_F32,
        .weights = {.head = w + t->head_at, .mean = w + t->mean_at, .basis = w + t->basis_at}};
    for (size_t l = 0; l < t->arch.depth; l++) {
        spec.weights.layer[l] = mlp_layer(&t->arch, w, l);
        spec.weights.bias[l] = mlp_bias(&t->arch, w, l);
    }
    return sdm_pod_build(&spec, bytes, size, err);
}

static void dispose(trainer *t)
{
    parameters_dispose(&t->fit);
    parameters_dispose(&t->refine);
    bases_dispose(t);
    sdm_free(t->exponents);
}

const train_kind pod_train = {.block = block,
                              .levels = levels,
                              .begin = begin,
                              .take = modes_project,
                              .errors = fit_errors,
                              .run = run,
                              .weights = weights,
                              .fingerprint = fingerprint,
                              .build = build,
                              .dispose = dispose};
