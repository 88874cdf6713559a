/* The `pod` network in the trainer: its architecture, its phases, its model file. */
#include "pod_kind.h"

#include <math.h>
#include <string.h>

#include "bases.h"
#include "data/streams.h"
#include "head_choice.h"
#include "mlp.h"
#include "mode_fit.h"
#include "modes.h"
#include "pod_parts.h"
#include "pod_ranks.h"
#include "refine.h"
#include "sdm/internal/checksum.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"
#include "state/checkpoint.h"
#include "state/progress.h"

static size_t pod_block(const sdm_config *c) { return (size_t)c->network.block; }

static size_t pod_levels(const sdm_config *c) { return (size_t)c->network.levels; }

/* The largest degree <= `degree` of polynomials with at most `terms` terms. */
static size_t limit_degree(size_t n_params, size_t degree, size_t terms)
{
    while (degree > 0 && sdm_poly_count(n_params, degree) > terms) degree--;
    return degree;
}

/* Sets the architecture as configured, with polynomial degrees that the number of maps made so far
   can determine. */
static sdm_status pod_design(pod_state *pod, sdm_error *err)
{
    trainer *t = pod->t;
    const sdm_config *c = t->config;
    sdm_pod_arch *a = &pod->arch;
    const dataset *d = &t->data;
    const size_t n_maps = d->n_static + d->n_start;
    a->n_params = d->n_params;
    a->n_voxels = d->n_voxels;
    a->levels = t->levels;
    a->block = (size_t)c->network.block;
    // polynomial degrees
    a->degree = limit_degree(a->n_params, (size_t)c->network.degree, 2 * n_maps / 3 + 1);
    if (a->degree < (size_t)c->network.degree)
        trainer_message(t,
                        "network.degree lowered from %d to %zu: %zu maps before training cannot "
                        "determine more terms",
                        c->network.degree, a->degree, n_maps);
    a->input_degree = limit_degree(a->n_params, (size_t)c->network.input_degree, 1024);
    if (a->input_degree < 1) a->input_degree = 1;
    if (a->input_degree < (size_t)c->network.input_degree)
        trainer_message(t, "network.input_degree lowered from %d to %zu: more than 1023 inputs",
                        c->network.input_degree, a->input_degree);
    // sizes of the MLP and of the latent vector
    a->depth = (size_t)c->network.depth;
    a->width = (size_t)c->network.width;
    a->activation = (int)c->network.activation;
    a->n_terms = sdm_poly_count(a->n_params, a->degree);
    a->n_inputs = sdm_poly_count(a->n_params, a->input_degree) - 1;
    a->n_latent = a->n_terms + (a->depth ? a->width : 0);
    pod->n_poly = a->n_terms > a->n_inputs + 1 ? a->n_terms : a->n_inputs + 1;
    const sdm_status s = SDM_ALLOC(&pod->exponents, pod->n_poly * a->n_params, "polynomials", err);
    if (s) return s;
    sdm_poly_table(a->n_params, a->degree > a->input_degree ? a->degree : a->input_degree,
                   pod->exponents);
    return SDM_OK;
}

/* Allocates the weights of the mode fit, with random initial values. */
static sdm_status pod_init_weights(pod_state *pod, sdm_error *err)
{
    const sdm_pod_arch *a = &pod->arch;
    parameters *p = &pod->mode_fit;
    const uint64_t seed = pod->t->config->seed;
    const size_t mlp = trainer_mlp_count(a);
    const sdm_status s = trainer_parameters_create(p, mlp + pod->n_modes * a->width, err);
    if (s) return s;
    trainer_mlp_init(a, seed, p->w);
    for (size_t i = mlp; i < p->n; i++)
        p->w[i] = (float)(0.3 / sqrt((double)a->width) * sdm_rng_normal(seed, STREAM_INIT, i));
    memcpy(p->average, p->w, p->n * sizeof *p->w);
    return SDM_OK;
}

static size_t decoder_weights(const pod_state *pod)
{
    const sdm_pod_arch *a = &pod->arch;
    return a->n_coefficients * a->n_latent + pod->matrix_at[a->levels.first[a->levels.n]];
}

static sdm_status pod_begin(trainer *t, sdm_error *err)
{
    pod_state *pod = NULL;
    const size_t n_maps = t->data.n_static + t->data.n_start;
    sdm_status s = SDM_ALLOC(&pod, 1, "training state", err);
    if (s) return s;
    t->state = pod;
    pod->t = t;
    pod->blocks = t->blocks;
    s = pod_design(pod, err);
    if (!s) s = trainer_bases_make(pod, err);
    if (!s) s = trainer_modes_make(pod, n_maps, err);
    if (s) return s;
    trainer_message(t,
                    "%zu maps; a decoder of %.3g million weights; bases and %zu modes leave %.2g "
                    "mm^2 on held-out shapes",
                    n_maps, 1e-6 * (double)decoder_weights(pod), pod->n_modes, pod->holdout_floor);
    return pod_init_weights(pod, err);
}

static sdm_status pod_samples_taken(trainer *t, const size_t *slots, size_t n, sdm_error *err)
{
    return trainer_modes_project(t->state, slots, n, err);
}

static sdm_status pod_errors(const trainer *t, const size_t *slots, size_t n, double *error,
                             sdm_error *err)
{
    return trainer_mode_fit_errors(t->state, slots, n, error, err);
}

static sdm_status pod_run(trainer *t, bool resumed, sdm_error *err)
{
    pod_state *pod = t->state;
    sdm_status s = SDM_OK;
    // the measurement of the model and of the parts of its error needs the rest of a time budget
    const double total = trainer_budget_seconds(t);
    pod->refine_end = total - fmin(10, 0.03 * total) - fmin(1, 0.05 * total);
    pod->mode_fit_end =
        t->phase_started + (pod->refine_end - t->phase_started) * (1 - t->config->train.refine);
    if (t->phase == SDM_PHASE_MODE_FIT) {
        if (resumed) s = trainer_checkpoint_weights(t, err);
        if (!s) s = trainer_mode_fit_run(pod, err);
        if (!s) s = trainer_refine_start(pod, false, err);
        if (!s) s = trainer_head_choose(pod, &t->heldout_mse, err);
        if (s) return s;
        trainer_enter(t, SDM_PHASE_REFINE);
        s = trainer_refine_note(pod, pod->refine.w, 0, err);
    } else {
        s = trainer_refine_start(pod, true, err);
        if (!s) s = trainer_checkpoint_weights(t, err);
    }
    return s ? s : trainer_refine_run(pod, err);
}

static parameters *pod_weights(trainer *t)
{
    pod_state *pod = t->state;
    return t->phase == SDM_PHASE_MODE_FIT ? &pod->mode_fit : &pod->refine;
}

static sdm_status pod_gather(trainer *t, sdm_error *err)
{
    return t->phase == SDM_PHASE_REFINE ? trainer_refine_gather(t->state, err) : SDM_OK;
}

/* Checksum over ranks, mean map, bases and modes. */
static uint64_t pod_fingerprint(const trainer *t)
{
    const pod_state *pod = t->state;
    const sdm_pod_arch *a = &pod->arch;
    const size_t n_blocks = a->levels.first[a->levels.n], basis = pod->matrix_at[n_blocks];
    uint64_t crc = 0;
    for (size_t b = 0; b < n_blocks; b++)
        crc = sdm_crc64(crc, &pod->blocks[b].rank, sizeof pod->blocks[b].rank);
    crc = sdm_crc64(crc, pod->mean, a->n_voxels * sizeof *pod->mean);
    crc = sdm_crc64(crc, pod->basis, basis * sizeof *pod->basis);
    return sdm_crc64(crc, pod->modes, pod->n_modes * a->n_coefficients * sizeof *pod->modes);
}

static sdm_status pod_build(const trainer *t, const sdm_model_info *info, uint8_t **bytes,
                            size_t *size, sdm_error *err)
{
    const pod_state *pod = t->state;
    const float *w = pod->refine.average;
    const sdm_weight_type type = t->config->network.weights;
    sdm_pod_spec spec = {.info = info,
                         .arch = pod->arch,
                         .blocks = pod->blocks,
                         .type = type == SDM_WEIGHT_I8    ? SDM_POD_I8
                                 : type == SDM_WEIGHT_F16 ? SDM_POD_F16
                                                          : SDM_POD_F32,
                         .weights = {.head = w + pod->head_at,
                                     .mean = w + pod->mean_at,
                                     .basis = w + pod->basis_at}};
    for (size_t l = 0; l < pod->arch.depth; l++) {
        spec.weights.layer[l] = trainer_mlp_layer(&pod->arch, w, l);
        spec.weights.bias[l] = trainer_mlp_bias(&pod->arch, w, l);
    }
    return sdm_pod_build(&spec, bytes, size, err);
}

static void pod_dispose(trainer *t)
{
    pod_state *pod = t->state;
    if (!pod) return;
    trainer_parameters_dispose(&pod->mode_fit);
    trainer_parameters_dispose(&pod->refine);
    sdm_free(pod->exponents);
    sdm_free(pod->phi);
    sdm_free(pod->holdout_phi);
    sdm_free(pod->mean);
    sdm_free(pod->basis);
    sdm_free(pod->matrix_at);
    sdm_free(pod->modes);
    sdm_free(pod->poly);
    sdm_free(pod->deviation);
    sdm_free(pod->target);
    sdm_free(pod->holdout_target);
    sdm_free(pod);
    t->state = NULL;
}

const train_kind trainer_kind_pod = {.block = pod_block,
                                     .levels = pod_levels,
                                     .shares = trainer_pod_shares,
                                     .begin = pod_begin,
                                     .samples_taken = pod_samples_taken,
                                     .errors = pod_errors,
                                     .run = pod_run,
                                     .weights = pod_weights,
                                     .gather = pod_gather,
                                     .fingerprint = pod_fingerprint,
                                     .build = pod_build,
                                     .parts = trainer_pod_parts,
                                     .dispose = pod_dispose};
