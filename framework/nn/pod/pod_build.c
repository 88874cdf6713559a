/* Builds the file of a pod model from its weights: description and packed sections. */
#include <string.h>

#include "pod_quantise.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"

#ifdef __BYTE_ORDER__
_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
               "weights are written as they are in memory: little-endian");
#endif

// writes the text that read_architecture() of pod_open.c reads
static void description_write(const sdm_pod_spec *spec, sdm_text *t)
{
    const sdm_pod_arch *k = &spec->arch;
    sdm_model_describe(spec->info, sdm_kind_pod.name, t);
    sdm_text_add(t,
                 "pod.degree=%zu\npod.input_degree=%zu\npod.depth=%zu\npod.width=%zu\npod."
                 "activation=%d\npod.type=%d\n",
                 k->degree, k->input_degree, k->depth, k->width, k->activation, (int)spec->type);
    sdm_text_add(t, "pod.block=%zu\npod.levels=%zu\n", k->block, k->levels.n);
}

static void pack_matrix(sdm_pod_type type, size_t outputs, size_t k, sdm_view w, void *to,
                        size_t offset)
{
    if (type == SDM_POD_F16)
        sdm_panel_pack_f16(outputs, k, w, (uint16_t *)to + offset);
    else
        sdm_panel_pack_f32(outputs, k, w, (float *)to + offset);
}

// Packs the MLP, the head and the basis. integers: the quantised weights, NULL for floats or
// halves; at[blocks]: sdm_pod_place_weights().
static void pack_weights(const sdm_pod_spec *spec, const pod_integers *integers, const size_t *at,
                         void *mlp, float *bias, void *head, void *basis)
{
    const sdm_pod_arch *a = &spec->arch;
    const size_t n_blocks = a->levels.first[a->levels.n];

    // MLP
    size_t next = 0, of_layer = 0;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = sdm_pod_layer_inputs(a, l);
        if (integers)
            sdm_panel_pack_i8(a->width, k, k, integers->mlp + of_layer, (int8_t *)mlp + next);
        else
            pack_matrix(spec->type, a->width, k, (sdm_view){spec->weights.layer[l], k, 1}, mlp,
                        next);
        next += sdm_pod_count_layer(spec->type, a, l);
        of_layer += a->width * k;
        memcpy(bias + l * a->width, spec->weights.bias[l], a->width * sizeof *bias);
    }

    // head
    if (integers)
        sdm_panel_pack_i8(a->n_coefficients, integers->wide[n_blocks], a->n_latent, integers->head,
                          head);
    else
        pack_matrix(spec->type, a->n_coefficients, a->n_latent,
                    (sdm_view){spec->weights.head, a->n_latent, 1}, head, 0);

    // basis of each block
    for (size_t b = 0, from = 0; b < n_blocks; b++) {
        const size_t outputs = sdm_pod_outputs(spec->blocks, b), rank = spec->blocks[b].rank;
        if (integers)
            sdm_panel_pack_i8(outputs, integers->wide[b], rank, integers->basis + from,
                              (int8_t *)basis + at[b]);
        else
            pack_matrix(spec->type, outputs, rank,
                        (sdm_view){spec->weights.basis + from, 1, outputs}, basis, at[b]);
        from += outputs * rank;
    }
}

// to[] = the mean map in the order of leaves[], each leaf padded to whole panels. The caller has
// set to[] to zero.
static void place_mean(const sdm_pod_spec *spec, const pod_leaf *leaves, float *to)
{
    for (size_t i = 0; i < spec->arch.levels.first[1]; i++) {
        const sdm_pod_block *b = &spec->blocks[leaves[i].block];
        const size_t n = sdm_pod_block_voxels(b);
        memcpy(to, spec->weights.mean + b->voxel, n * sizeof *to);
        to += sdm_panel_outputs(n);
    }
}

// to[4 n] = from[n], little-endian
static void store_u32(const uint32_t *from, size_t n, uint8_t *to)
{
    for (size_t i = 0; i < n; i++)
        for (int b = 0; b < 4; b++) *to++ = (uint8_t)(from[i] >> (8 * b));
}

// Builds the model file. integers: the quantised weights; NULL for floats or halves.
static sdm_status file_build(const sdm_pod_spec *spec, const pod_integers *integers,
                             uint8_t **bytes, size_t *size, sdm_error *err)
{
    const sdm_pod_arch *a = &spec->arch;
    const size_t number = sdm_pod_weight_bytes(spec->type), n_blocks = a->levels.first[a->levels.n];
    const size_t mlp_count = sdm_pod_count_mlp(spec->type, a);
    const size_t head_count = sdm_pod_count_weights(
        spec->type, a->n_coefficients, integers ? integers->wide[n_blocks] : 0, a->n_latent);
    const size_t mean_count = sdm_pod_mean_count(&a->levels, spec->blocks);

    // slabs, leaves, index of the weights of each block
    pod_slab *slabs = NULL;
    pod_leaf *leaves = NULL;
    float *bias = NULL, *mean = NULL;
    size_t *at = NULL, basis_count = 0, all[SDM_POD_MAX_LEVELS + 1];
    uint8_t *mlp = NULL, *head = NULL, *basis = NULL, *ranks = NULL, *wide = NULL,
            limit[4 * (SDM_POD_MAX_LEVELS + 1 + SDM_POD_MAX_DEPTH)];
    sdm_text text = {0};
    sdm_status s = SDM_ALLOC(&at, n_blocks, "model weights", err);
    if (!s)
        s = SDM_ALLOC(&slabs, n_blocks - a->levels.first[a->levels.n - 1], "model weights", err);
    if (!s) s = SDM_ALLOC(&leaves, a->levels.first[1], "model weights", err);
    if (!s)
        basis_count =
            sdm_pod_place_weights(spec->type, &a->levels, spec->blocks, slabs,
                                  sdm_pod_slabs(&a->levels, spec->blocks, a->block, slabs, leaves),
                                  leaves, integers ? integers->wide : NULL, at);

    // memory for the sections
    if (!s) s = SDM_ALLOC(&mean, mean_count, "model weights", err);
    if (!s) s = SDM_ALLOC(&mlp, mlp_count * number, "model weights", err);
    if (!s) s = SDM_ALLOC(&bias, a->depth * a->width, "model weights", err);
    if (!s) s = SDM_ALLOC(&head, head_count * number, "model weights", err);
    if (!s) s = SDM_ALLOC(&basis, basis_count * number, "model weights", err);
    if (!s) s = SDM_ALLOC(&ranks, n_blocks * 4, "model weights", err);
    if (!s) s = SDM_ALLOC(&wide, (n_blocks + 1) * 4, "model weights", err);
    if (s) goto done;

    // fill the sections
    pack_weights(spec, integers, at, mlp, bias, head, basis);
    place_mean(spec, leaves, mean);
    for (size_t b = 0; b < n_blocks; b++) store_u32(&spec->blocks[b].rank, 1, ranks + 4 * b);
    if (integers) {
        store_u32(integers->wide, n_blocks + 1, wide);
        store_u32(integers->limit, a->levels.n + 1, limit);
        store_u32(integers->layer_limit, a->depth, limit + 4 * (a->levels.n + 1));
    }
    sdm_pod_place_coefficients(&a->levels, spec->blocks, all);
    description_write(spec, &text);

    // the last six sections are for integer weights only
    const sdm_section sections[] = {
        {"pod.ranks", ranks, n_blocks * 4},
        {"pod.mlp", mlp, mlp_count * number},
        {"pod.bias", bias, a->depth * a->width * sizeof *bias},
        {"pod.head", head, head_count * number},
        {"pod.basis", basis, basis_count * number},
        {"pod.mean", mean, mean_count * sizeof(float)},
        {"pod.wide", wide, (n_blocks + 1) * 4},
        {"pod.limit", limit, (a->levels.n + 1 + a->depth) * 4},
        {"pod.layer_scale", integers ? integers->layer_scale : NULL,
         a->depth * a->width * sizeof(float)},
        {"pod.order", integers ? integers->order : NULL, a->n_latent * sizeof(uint32_t)},
        {"pod.factor", integers ? integers->factor : NULL,
         (all[a->levels.n] + a->n_latent) * sizeof(float)},
        {"pod.quantum", integers ? integers->quantum : NULL, n_blocks * sizeof(float)}};
    const size_t n = sizeof sections / sizeof *sections;
    s = sdm_model_pack(spec->info, &text, sections, integers ? n : n - 6, bytes, size, err);
done:
    sdm_text_dispose(&text);
    sdm_free(wide);
    sdm_free(ranks);
    sdm_free(basis);
    sdm_free(head);
    sdm_free(bias);
    sdm_free(mlp);
    sdm_free(mean);
    sdm_free(leaves);
    sdm_free(slabs);
    sdm_free(at);
    return s;
}

sdm_status sdm_pod_build(const sdm_pod_spec *spec, uint8_t **bytes, size_t *size, sdm_error *err)
{
    if (spec->type != SDM_POD_I8) return file_build(spec, NULL, bytes, size, err);
    pod_integers integers;
    sdm_status s = sdm_pod_quantise(spec, &integers, err);
    if (!s) s = file_build(spec, &integers, bytes, size, err);
    sdm_pod_integers_dispose(&integers);
    return s;
}
