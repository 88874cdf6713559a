/* Making of a model file from weights: texts, architecture, tiles. */
#include <string.h>

#include "model_internal.h"
#include "sdm/container.h"
#include "sdm/kernels.h"
#include "sdm/memory.h"
#include "sdm/text.h"

#ifdef __BYTE_ORDER__
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "weights are written as they lie in memory: little-endian");
#endif

static void real(sdm_text *t, const char *key, double v)
{
    char buf[32];
    sdm_text_add(t, "%s=%s\n", key, sdm_format_real(v, buf));
}

static void reals(sdm_text *t, const char *key, const double *v, size_t n)
{
    char buf[32];
    sdm_text_add(t, "%s=", key);
    for (size_t i = 0; i < n; i++) sdm_text_add(t, "%s%s", i ? " " : "", sdm_format_real(v[i], buf));
    sdm_text_add(t, "\n");
}

// one "key=value" a line, in this fixed order; read back by model_open.c
static void meta(const sdm_pod_spec *spec, sdm_text *t)
{
    const sdm_model_info *i = spec->info;
    const sdm_accuracy *a = &i->accuracy;
    sdm_text_add(t, "kind=pod\nversion=%s\nshape=%s\n", SDM_VERSION_TEXT, i->shape);
    sdm_text_add(t, "grid.size=%lld %lld %lld\n", (long long)i->grid.n[0], (long long)i->grid.n[1],
                 (long long)i->grid.n[2]);
    reals(t, "grid.origin", i->grid.origin, 3);
    reals(t, "grid.spacing", i->grid.spacing, 3);
    reals(t, "grid.direction", i->grid.dir, 9);
    sdm_text_add(t, "unit=mm\nsign=negative inside\nframe=LPS\n");
    sdm_text_add(t, "params=%zu\n", i->n_params);
    for (size_t p = 0; p < i->n_params; p++) {
        const sdm_model_param *q = &i->params[p];
        sdm_text_add(t, "param.name=%s\nparam.unit=%s\n", q->name, q->unit);
        reals(t, "param.range", (const double[]){q->min, q->max, q->def}, 3);
    }
    sdm_text_add(t, "options=%zu\n", i->n_options);
    for (size_t o = 0; o < i->n_options; o++)
        sdm_text_add(t, "option.name=%s\noption.value=%s\n", i->option_names[o], i->option_values[o]);
    sdm_text_add(t, "accuracy.samples=%lld\n", (long long)a->samples);
    real(t, "accuracy.mse_mm2", a->mse_mm2);
    real(t, "accuracy.rmse_mm", a->rmse_mm);
    real(t, "accuracy.mae_mm", a->mae_mm);
    real(t, "accuracy.max_abs_mm", a->max_abs_mm);
    real(t, "accuracy.rmse_near_mm", a->rmse_near_mm);
    reals(t, "accuracy.quantiles_mm", (const double[]){a->q50_mm, a->q90_mm, a->q99_mm}, 3);
    sdm_text_add(t, "seed=%llu\n", (unsigned long long)i->seed);
    real(t, "train.seconds", i->train_seconds);
    sdm_text_add(t, "train.samples=%lld\n", (long long)i->train_samples);
    const sdm_pod_arch *k = &spec->arch;
    sdm_text_add(t,
                 "pod.degree=%zu\npod.input_degree=%zu\npod.depth=%zu\npod.width=%zu\npod.activation=%d\npod.half=%d\n",
                 k->degree, k->input_degree, k->depth, k->width, k->activation, spec->half);
    sdm_text_add(t, "pod.block=%zu\n", k->block);
}

size_t sdm_pod_mlp_floats(const sdm_pod_arch *a)
{
    size_t n = 0;
    for (size_t l = 0; l < a->depth; l++)
        n += sdm_tiled_count(a->width, sdm_pod_layer_inputs(a, l)) + sdm_tiled_count(a->width, 1);
    return n;
}

size_t sdm_pod_basis_count(const sdm_pod_block *blocks, size_t n_blocks)
{
    size_t n = 0;
    for (size_t b = 0; b < n_blocks; b++) n += sdm_tiled_count(sdm_pod_block_voxels(&blocks[b]), blocks[b].rank);
    return n;
}

static void pack_matrix(bool half, size_t outputs, size_t k, sdm_view w, void *to, size_t offset)
{
    if (half)
        sdm_tiled_pack_f16(outputs, k, w, (uint16_t *)to + offset);
    else
        sdm_tiled_pack_f32(outputs, k, w, (float *)to + offset);
}

static void pack_weights(const sdm_pod_spec *spec, float *mlp, void *head, void *basis)
{
    const sdm_pod_arch *a = &spec->arch;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = sdm_pod_layer_inputs(a, l);
        sdm_tiled_pack_f32(a->width, k, (sdm_view){spec->weights.layer[l], k, 1}, mlp);
        mlp += sdm_tiled_count(a->width, k);
        memcpy(mlp, spec->weights.bias[l], a->width * sizeof *mlp);
        mlp += sdm_tiled_count(a->width, 1);
    }
    pack_matrix(spec->half, a->n_coefficients, a->n_latent, (sdm_view){spec->weights.head, a->n_latent, 1}, head, 0);
    size_t offset = 0;
    const float *from = spec->weights.basis;
    for (size_t b = 0; b < a->n_blocks; b++) {
        const size_t voxels = sdm_pod_block_voxels(&spec->blocks[b]), rank = spec->blocks[b].rank;
        pack_matrix(spec->half, voxels, rank, (sdm_view){from, 1, voxels}, basis, offset);
        offset += sdm_tiled_count(voxels, rank);
        from += voxels * rank;
    }
}

sdm_status sdm_model_build(const sdm_pod_spec *spec, uint8_t **bytes, size_t *size, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    const size_t weight = spec->half ? sizeof(uint16_t) : sizeof(float);
    const size_t mlp_floats = sdm_pod_mlp_floats(a), head_count = sdm_tiled_count(a->n_coefficients, a->n_latent);
    const size_t basis_count = sdm_pod_basis_count(spec->blocks, a->n_blocks);
    float *mlp = NULL;
    uint8_t *head = NULL, *basis = NULL, *ranks = NULL;
    sdm_text text = {0};
    sdm_status s = SDM_ALLOC(&mlp, mlp_floats, "model weights", err);
    if (!s) s = SDM_ALLOC(&head, head_count * weight, "model weights", err);
    if (!s) s = SDM_ALLOC(&basis, basis_count * weight, "model weights", err);
    if (!s) s = SDM_ALLOC(&ranks, a->n_blocks * 4, "model weights", err);
    if (s) goto done;
    pack_weights(spec, mlp, head, basis);
    for (size_t b = 0; b < a->n_blocks; b++)
        for (int i = 0; i < 4; i++) ranks[4 * b + (size_t)i] = (uint8_t)(spec->blocks[b].rank >> (8 * i));
    meta(spec, &text);
    if (text.failed) {
        s = sdm_fail(err, SDM_E_NOMEM, "no memory for the model's description");
        goto done;
    }
    const char *config = spec->info->config ? spec->info->config : "";
    const sdm_section sections[] = {{"meta", text.data, text.size},
                                    {"config", config, strlen(config)},
                                    {"pod.ranks", ranks, a->n_blocks * 4},
                                    {"pod.mlp", mlp, mlp_floats * sizeof *mlp},
                                    {"pod.head", head, head_count * weight},
                                    {"pod.basis", basis, basis_count * weight},
                                    {"pod.mean", spec->weights.mean, a->n_voxels * sizeof(float)}};
    s = sdm_container_build(sections, sizeof sections / sizeof *sections, bytes, size, err);
done:
    sdm_text_dispose(&text);
    sdm_free(ranks);
    sdm_free(basis);
    sdm_free(head);
    sdm_free(mlp);
    return s;
}
