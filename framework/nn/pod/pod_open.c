/* Opens a pod model: reads architecture, ranks of the blocks and weights, and checks every size
   before it is used. */
#include <stdint.h>

#include "pod_internal.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"

static sdm_status read_architecture(sdm_lines *lines, size_t n_params, pod_network *m,
                                    sdm_error *err)
{
    sdm_pod_arch *a = &m->arch;
    a->n_params = n_params;
    a->degree = (size_t)sdm_lines_int(lines, "pod.degree", 0, 12);
    a->input_degree = (size_t)sdm_lines_int(lines, "pod.input_degree", 1, 12);
    a->depth = (size_t)sdm_lines_int(lines, "pod.depth", 0, SDM_POD_MAX_DEPTH);
    a->width = (size_t)sdm_lines_int(lines, "pod.width", 1, 65536);
    a->activation = (int)sdm_lines_int(lines, "pod.activation", 0, 3);
    m->type = (sdm_pod_type)sdm_lines_int(lines, "pod.type", 0, SDM_POD_I8);
    a->block = (size_t)sdm_lines_int(lines, "pod.block", 1, 64);
    a->levels.n = (size_t)sdm_lines_int(lines, "pod.levels", 1, SDM_POD_MAX_LEVELS);
    return sdm_lines_check(lines, err);
}

// little-endian
static uint32_t read_u32(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

// Reads the ranks of all blocks. Derives from them the sizes of arrays, and the slabs, which
// determine the order in which the weights are stored.
static sdm_status read_ranks(const sdm_section *ranks, pod_network *m, sdm_error *err)
{
    sdm_pod_arch *a = &m->arch;
    const size_t n_blocks = a->levels.first[a->levels.n],
                 highest = a->levels.first[a->levels.n - 1];
    const uint8_t *p = ranks->data;
    for (size_t b = 0; b < n_blocks; b++, p += 4) {
        sdm_pod_block *k = &m->blocks[b];
        k->rank = read_u32(p);
        if (k->rank > 1u << 20)
            return sdm_fail(err, SDM_E_FORMAT, "damaged: a block of rank %u", k->rank);
        if (b >= highest) a->n_coefficients += k->rank;
    }
    if (a->n_coefficients < 1 || a->n_coefficients > 1u << 30)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: %zu coefficients", a->n_coefficients);

    // number of outputs of each block, sizes of groups
    sdm_pod_number(&a->levels, m->blocks);
    for (size_t level = 0; level < a->levels.n; level++)
        for (size_t b = a->levels.first[level]; b < a->levels.first[level + 1]; b++) {
            const size_t outputs = sdm_pod_outputs(m->blocks, b);
            if (outputs > 1u << 20 || m->blocks[b].rank > outputs)
                return sdm_fail(err, SDM_E_FORMAT, "damaged: rank %u of a block of %zu numbers",
                                m->blocks[b].rank, outputs);
            m->outputs[b] = (uint32_t)outputs;
            if (outputs > m->max_outputs[level]) m->max_outputs[level] = outputs;
            const size_t group = level + 1 < a->levels.n ? 0 : m->blocks[b].rank;
            if (group > m->max_group[level]) m->max_group[level] = group;
        }
    for (size_t level = 0; level + 1 < a->levels.n; level++)
        m->max_group[level] = m->max_outputs[level + 1];

    // slabs
    sdm_pod_place_coefficients(&a->levels, m->blocks, m->coefficients_at);
    m->n_slabs = sdm_pod_slabs(&a->levels, m->blocks, a->block, m->slabs, m->leaves);
    for (const pod_slab *k = m->slabs; k < m->slabs + m->n_slabs; k++) {
        if (k->n_coefficients > m->max_slab) m->max_slab = k->n_coefficients;
        if (k->group_end - k->group > m->max_slab_groups)
            m->max_slab_groups = k->group_end - k->group;
    }
    return SDM_OK;
}

// Makes the blocks from the grid and the ranks, and computes the sizes that follow from the
// architecture.
static sdm_status blocks_set_up(const sdm_section *ranks, const sdm_grid *grid, pod_network *m,
                                sdm_error *err)
{
    sdm_pod_arch *a = &m->arch;
    sdm_status s;
    const size_t terms = sdm_poly_count(a->n_params, a->degree),
                 inputs = sdm_poly_count(a->n_params, a->input_degree);
    const size_t n_levels = a->levels.n;
    a->levels = sdm_pod_count(grid, a->block, n_levels);
    const size_t n_blocks = a->levels.first[a->levels.n];
    if (terms > 1u << 20 || inputs > 1u << 20 || a->levels.n != n_levels ||
        ranks->size / 4 != n_blocks || ranks->size % 4)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: %zu ranks of blocks, the grid has %zu blocks",
                        ranks->size / 4, n_blocks);

    // sizes, memory, blocks
    a->n_terms = terms;
    a->n_inputs = inputs - 1;
    a->n_latent = terms + (a->depth ? a->width : 0);
    a->n_voxels = sdm_grid_count(grid);
    if ((s = SDM_ALLOC(&m->blocks, n_blocks, "model blocks", err))) return s;
    if ((s = SDM_ALLOC(&m->outputs, n_blocks, "model blocks", err))) return s;
    if ((s = SDM_ALLOC(&m->weights_at, n_blocks, "model blocks", err))) return s;
    if ((s = SDM_ALLOC(&m->slabs, n_blocks - a->levels.first[a->levels.n - 1], "model blocks",
                       err)))
        return s;
    if ((s = SDM_ALLOC(&m->leaves, a->levels.first[1], "model blocks", err))) return s;
    if ((s = SDM_ALLOC(&m->products, a->levels.first[1], "model blocks", err))) return s;
    sdm_pod_blocks(grid, a->block, &a->levels, m->blocks);
    if ((s = read_ranks(ranks, m, err))) return s;

    // one table of polynomials for both degrees
    const size_t poly = inputs > terms ? inputs : terms;
    const size_t degree = a->degree > a->input_degree ? a->degree : a->input_degree;
    if ((s = SDM_ALLOC(&m->exponents, poly * a->n_params, "model polynomials", err))) return s;
    sdm_poly_table(a->n_params, degree, m->exponents);
    return SDM_OK;
}

// Reads the tables that only integer weights have: numbers of wide inputs, order of the head's
// columns, factors, quanta, limits, row scales of the MLP.
static sdm_status read_integer_tables(const sdm_section *sections, size_t n, sdm_model *model,
                                      sdm_error *err)
{
    pod_network *m = model->network;
    const sdm_pod_arch *a = &m->arch;
    const size_t n_blocks = a->levels.first[a->levels.n];
    const uint8_t *wide =
        sdm_model_weights(model, sections, n, "pod.wide", SDM_NUMBER_INT32, n_blocks + 1, err);
    if (!wide) return SDM_E_FORMAT;
    m->order =
        sdm_model_weights(model, sections, n, "pod.order", SDM_NUMBER_INT32, a->n_latent, err);
    if (!m->order) return SDM_E_FORMAT;
    m->factor = sdm_model_weights(model, sections, n, "pod.factor", SDM_NUMBER_FLOAT32,
                                  m->coefficients_at[a->levels.n] + a->n_latent, err);
    if (!m->factor) return SDM_E_FORMAT;
    m->quantum =
        sdm_model_weights(model, sections, n, "pod.quantum", SDM_NUMBER_FLOAT32, n_blocks, err);
    if (!m->quantum) return SDM_E_FORMAT;

    // memory
    sdm_status s = SDM_ALLOC(&m->wide, n_blocks + 1, "model blocks", err);
    if (!s)
        s = SDM_ALLOC(&m->to_integer, m->coefficients_at[a->levels.n] + SDM_PANEL, "model blocks",
                      err);
    if (s) return s;

    // order of the head's columns
    for (size_t i = 0; i < a->n_latent; i++)
        if (m->order[i] >= a->n_latent)
            return sdm_fail(err, SDM_E_FORMAT, "damaged: latent variable %u of %zu", m->order[i],
                            a->n_latent);

    // limits, scales of the MLP
    const size_t n_limits = a->levels.n + 1 + a->depth;
    const uint8_t *limits =
        sdm_model_weights(model, sections, n, "pod.limit", SDM_NUMBER_INT32, n_limits, err);
    if (!limits) return SDM_E_FORMAT;
    for (size_t i = 0; i < n_limits; i++) {
        const uint32_t limit = read_u32(limits + 4 * i);
        if (limit < 1 || limit > INT16_MAX)
            return sdm_fail(err, SDM_E_FORMAT, "damaged: integers up to %u", limit);
        *(i <= a->levels.n ? &m->limit[i] : &m->layer_limit[i - a->levels.n - 1]) = (int)limit;
    }
    const float *scale = sdm_model_weights(model, sections, n, "pod.layer_scale",
                                           SDM_NUMBER_FLOAT32, a->depth * a->width, err);
    if (!scale) return SDM_E_FORMAT;
    for (size_t l = 0; l < a->depth; l++) m->layer_scale[l] = scale + l * a->width;

    // derive to_integer = factor / quantum; read the number of wide inputs of each block
    for (size_t level = 0; level < a->levels.n; level++)
        for (size_t b = a->levels.first[level]; b < a->levels.first[level + 1]; b++) {
            const size_t at = m->coefficients_at[level] + m->blocks[b].coefficient;
            for (size_t i = at; i < at + m->blocks[b].rank; i++)
                m->to_integer[i] = m->quantum[b] > 0 ? m->factor[i] / m->quantum[b] : 0;
            m->wide[b] = read_u32(wide + 4 * b);
            if (m->wide[b] > m->blocks[b].rank)
                return sdm_fail(err, SDM_E_FORMAT, "damaged: %u wide columns of a block of rank %u",
                                m->wide[b], m->blocks[b].rank);
        }
    m->wide[n_blocks] = read_u32(wide + 4 * n_blocks);
    if (m->wide[n_blocks] > a->n_latent)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: %u wide columns of %zu", m->wide[n_blocks],
                        a->n_latent);
    return SDM_OK;
}

// Points the network to its weights in the file.
static sdm_status bind_weights(const sdm_section *sections, size_t n, sdm_model *model,
                               sdm_error *err)
{
    pod_network *m = model->network;
    const sdm_pod_arch *a = &m->arch;
    const size_t weight = sdm_pod_weight_bytes(m->type);
    if (m->type == SDM_POD_I8) {
        const sdm_status s = read_integer_tables(sections, n, model, err);
        if (s) return s;
    }

    // sections, types and counts
    static const sdm_number number_of[] = {[SDM_POD_F32] = SDM_NUMBER_FLOAT32,
                                           [SDM_POD_F16] = SDM_NUMBER_FLOAT16,
                                           [SDM_POD_I8] = SDM_NUMBER_BYTE};
    const sdm_number type = number_of[m->type];
    const struct {
        const char *name;
        sdm_number type;
        size_t count;
    } need[] = {
        {"pod.mlp", type, sdm_pod_count_mlp(m->type, a)},
        {"pod.head", type,
         sdm_pod_count_weights(m->type, a->n_coefficients, sdm_pod_head_wide(m), a->n_latent)},
        {"pod.basis", type,
         sdm_pod_place_weights(m->type, &a->levels, m->blocks, m->slabs, m->n_slabs, m->leaves,
                               m->wide, m->weights_at)},
        {"pod.mean", SDM_NUMBER_FLOAT32, sdm_pod_mean_count(&a->levels, m->blocks)},
        {"pod.bias", SDM_NUMBER_FLOAT32, a->depth * a->width},
    };
    const void *data[5];
    for (int i = 0; i < 5; i++) {
        data[i] =
            sdm_model_weights(model, sections, n, need[i].name, need[i].type, need[i].count, err);
        if (!data[i]) return SDM_E_FORMAT;
    }

    // layers of the MLP, head, basis, mean map
    const uint8_t *mlp = data[0];
    for (size_t l = 0; l < a->depth; l++) {
        m->layer[l] = mlp;
        mlp += sdm_pod_count_layer(m->type, a, l) * weight;
        m->bias[l] = (const float *)data[4] + l * a->width;
    }
    m->head = data[1];
    m->basis = data[2];
    m->mean = data[3];
    sdm_pod_products_fill(m);
    return SDM_OK;
}

static double count_macs(const pod_network *m)
{
    const sdm_pod_arch *a = &m->arch;
    double n = (double)a->n_coefficients * (double)a->n_latent;
    for (size_t l = 0; l < a->depth; l++)
        n += (double)a->width * (double)sdm_pod_layer_inputs(a, l);
    for (size_t b = 0; b < a->levels.first[a->levels.n]; b++)
        n += (double)m->blocks[b].rank * m->outputs[b];
    return n;
}

static sdm_status open_network(sdm_model *m, sdm_lines *lines, const sdm_section *sections,
                               size_t n, sdm_error *err)
{
    pod_network *k = NULL;
    const sdm_section *ranks = sdm_section_find(sections, n, "pod.ranks");
    if (!ranks) return sdm_fail(err, SDM_E_FORMAT, "damaged: a section of a model is missing");
    sdm_status s = SDM_ALLOC(&k, 1, "model", err);
    if (s) return s;
    m->network = k;
    s = read_architecture(lines, m->info.n_params, k, err);
    if (!s) s = blocks_set_up(ranks, &m->info.grid, k, err);
    if (!s) s = bind_weights(sections, n, m, err);
    if (s) return s;
    m->info.macs = count_macs(k);
    // Each multiply-add of a map uses a different weight. If the file has fewer bytes of weights
    // than multiply-adds need, a computed size has overflowed.
    if (m->info.macs * (double)sdm_pod_weight_bytes(k->type) > (double)m->info.weight_bytes)
        return sdm_fail(err, SDM_E_FORMAT, "damaged: %zu bytes of weights for %.0f of them",
                        m->info.weight_bytes, m->info.macs);
    return SDM_OK;
}

static void network_free(void *network)
{
    pod_network *m = network;
    if (!m) return;
    sdm_free(m->blocks);
    sdm_free(m->outputs);
    sdm_free(m->weights_at);
    sdm_free(m->exponents);
    sdm_free(m->wide);
    sdm_free(m->to_integer);
    sdm_free(m->leaves);
    sdm_free(m->products);
    sdm_free(m->slabs);
    sdm_free(m);
}

const sdm_model_kind sdm_kind_pod = {.name = "pod",
                                     .open = open_network,
                                     .dispose = network_free,
                                     .scratch_bytes = sdm_pod_scratch_bytes,
                                     .forward = sdm_pod_forward,
                                     .jacobian_scratch_bytes = sdm_pod_jacobian_scratch_bytes,
                                     .jacobian = sdm_pod_jacobian,
                                     .jvp_scratch_bytes = sdm_pod_jvp_scratch_bytes,
                                     .jvp = sdm_pod_jvp,
                                     .vjp_scratch_bytes = sdm_pod_vjp_scratch_bytes,
                                     .vjp = sdm_pod_vjp,
                                     .onnx = sdm_pod_onnx};
