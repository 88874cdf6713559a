/* Making of a pod model's file from weights: architecture and panels. */
#include <string.h>

#include "pod_internal.h"
#include "sdm/kernels.h"
#include "sdm/memory.h"

#ifdef __BYTE_ORDER__
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "weights are written as they lie in memory: little-endian");
#endif

// read back by pod_open.c
static void describe(const sdm_pod_spec *spec, sdm_text *t)
{
    const sdm_pod_arch *k = &spec->arch;
    sdm_model_describe(spec->info, sdm_kind_pod.name, t);
    sdm_text_add(t,
                 "pod.degree=%zu\npod.input_degree=%zu\npod.depth=%zu\npod.width=%zu\npod.activation=%d\npod.half=%d\n",
                 k->degree, k->input_degree, k->depth, k->width, k->activation, spec->half);
    sdm_text_add(t, "pod.block=%zu\npod.levels=%zu\n", k->block, k->levels.n);
}

size_t sdm_pod_mlp_count(const sdm_pod_arch *a)
{
    size_t n = 0;
    for (size_t l = 0; l < a->depth; l++) n += sdm_panel_count(a->width, sdm_pod_layer_inputs(a, l));
    return n;
}

static size_t place_block(const sdm_pod_block *blocks, size_t b, size_t next, size_t *at)
{
    at[b] = next;
    next += sdm_panel_count(sdm_pod_outputs(blocks, b), blocks[b].rank);
    for (size_t i = 0; i < blocks[b].n_children; i++) next = place_block(blocks, blocks[b].child + i, next, at);
    return next;
}

size_t sdm_pod_place_weights(const sdm_pod_levels *levels, const sdm_pod_block *blocks, size_t *at)
{
    size_t next = 0;
    for (size_t b = levels->first[levels->n - 1]; b < levels->first[levels->n]; b++)
        next = place_block(blocks, b, next, at);
    return next;
}

static void pack_matrix(bool half, size_t outputs, size_t k, sdm_view w, void *to, size_t offset)
{
    if (half)
        sdm_panel_pack_f16(outputs, k, w, (uint16_t *)to + offset);
    else
        sdm_panel_pack_f32(outputs, k, w, (float *)to + offset);
}

static void pack_weights(const sdm_pod_spec *spec, const size_t *at, void *mlp, float *bias, void *head, void *basis)
{
    const sdm_pod_arch *a = &spec->arch;
    size_t next = 0;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = sdm_pod_layer_inputs(a, l);
        pack_matrix(spec->half, a->width, k, (sdm_view){spec->weights.layer[l], k, 1}, mlp, next);
        next += sdm_panel_count(a->width, k);
        memcpy(bias + l * a->width, spec->weights.bias[l], a->width * sizeof *bias);
    }
    pack_matrix(spec->half, a->n_coefficients, a->n_latent, (sdm_view){spec->weights.head, a->n_latent, 1}, head, 0);
    const float *from = spec->weights.basis;
    for (size_t b = 0; b < a->levels.first[a->levels.n]; b++) {
        const size_t outputs = sdm_pod_outputs(spec->blocks, b), rank = spec->blocks[b].rank;
        pack_matrix(spec->half, outputs, rank, (sdm_view){from, 1, outputs}, basis, at[b]);
        from += outputs * rank;
    }
}

sdm_status sdm_pod_build(const sdm_pod_spec *spec, uint8_t **bytes, size_t *size, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    const size_t weight = spec->half ? sizeof(uint16_t) : sizeof(float), n_blocks = a->levels.first[a->levels.n];
    const size_t mlp_count = sdm_pod_mlp_count(a), head_count = sdm_panel_count(a->n_coefficients, a->n_latent);
    float *bias = NULL;
    size_t *at = NULL, basis_count = 0;
    uint8_t *mlp = NULL, *head = NULL, *basis = NULL, *ranks = NULL;
    sdm_text text = {0};
    sdm_status s = SDM_ALLOC(&at, n_blocks, "model weights", err);
    if (!s) basis_count = sdm_pod_place_weights(&a->levels, spec->blocks, at);
    if (!s) s = SDM_ALLOC(&mlp, mlp_count * weight, "model weights", err);
    if (!s) s = SDM_ALLOC(&bias, a->depth * a->width, "model weights", err);
    if (!s) s = SDM_ALLOC(&head, head_count * weight, "model weights", err);
    if (!s) s = SDM_ALLOC(&basis, basis_count * weight, "model weights", err);
    if (!s) s = SDM_ALLOC(&ranks, n_blocks * 4, "model weights", err);
    if (s) goto done;
    pack_weights(spec, at, mlp, bias, head, basis);
    for (size_t b = 0; b < n_blocks; b++)
        for (int i = 0; i < 4; i++) ranks[4 * b + (size_t)i] = (uint8_t)(spec->blocks[b].rank >> (8 * i));
    describe(spec, &text);
    const sdm_section sections[] = {{"pod.ranks", ranks, n_blocks * 4},
                                    {"pod.mlp", mlp, mlp_count * weight},
                                    {"pod.bias", bias, a->depth * a->width * sizeof *bias},
                                    {"pod.head", head, head_count * weight},
                                    {"pod.basis", basis, basis_count * weight},
                                    {"pod.mean", spec->weights.mean, a->n_voxels * sizeof(float)}};
    s = sdm_model_pack(spec->info, &text, sections, sizeof sections / sizeof *sections, bytes, size, err);
done:
    sdm_text_dispose(&text);
    sdm_free(ranks);
    sdm_free(basis);
    sdm_free(head);
    sdm_free(bias);
    sdm_free(mlp);
    sdm_free(at);
    return s;
}
