/* Opens a point network: reads architecture and weights, and checks every size before it is
   used. */
#include "point_internal.h"
#include "sdm/internal/kernels.h"
#include "sdm/memory.h"

static sdm_status read_architecture(sdm_lines *lines, size_t n_params, point_network *k,
                                    sdm_error *err)
{
    sdm_point_arch *a = &k->arch;
    a->n_params = n_params;
    a->depth = (size_t)sdm_lines_int(lines, "point.depth", 1, SDM_POINT_MAX_DEPTH);
    for (size_t l = 0; l < a->depth; l++) {
        a->width[l] = (size_t)sdm_lines_int(lines, "point.width", 1, SDM_POINT_MAX_WIDTH);
        if (sdm_lines_int(lines, "point.input", l ? 0 : 1, 1) && l) a->skip |= 1u << l;
        if (a->width[l] > k->max_width) k->max_width = a->width[l];
    }
    a->activation = (int)sdm_lines_int(lines, "point.activation", 0, 3);
    a->tanh_output = sdm_lines_int(lines, "point.tanh", 0, 1) != 0;
    k->half = sdm_lines_int(lines, "point.half", 0, 1) != 0;
    sdm_lines_reals(lines, "point.centre", a->centre, 3);
    a->radius = sdm_lines_real(lines, "point.radius");
    if (!(a->radius > 0)) lines->failed = true;
    a->scale = sdm_lines_real(lines, "point.scale");
    if (!(a->scale > 0)) lines->failed = true;
    return sdm_lines_check(lines, err);
}

// Returns R, the number of points whose activations fit in the second-level cache: 48 .. 192, and a
// multiple of 12, so that the kernels, which process 6 rows at a time, have whole passes.
static size_t rows_at_once(size_t width)
{
    const size_t n = 98304 / width / 12 * 12;
    return n < 48 ? 48 : n > 192 ? 192 : n;
}

static sdm_status open_network(sdm_model *m, sdm_lines *lines, const sdm_section *sections,
                               size_t n, sdm_error *err)
{
    point_network *k = NULL;
    sdm_status s = SDM_ALLOC(&k, 1, "model", err);
    if (s) return s;
    m->network = k;
    if ((s = read_architecture(lines, m->info.n_params, k, err))) return s;
    const sdm_point_arch *a = &k->arch;
    size_t input_at[SDM_POINT_MAX_DEPTH];
    const size_t hidden = sdm_point_hidden_count(a, k->hidden_at),
                 inputs = sdm_point_input_count(a, input_at);
    k->hidden = sdm_model_weights(m, sections, n, "point.hidden",
                                  k->half ? SDM_NUMBER_FLOAT16 : SDM_NUMBER_FLOAT32, hidden, err);
    if (!k->hidden) return SDM_E_FORMAT;
    const float *input =
        sdm_model_weights(m, sections, n, "point.input", SDM_NUMBER_FLOAT32, inputs, err);
    if (!input) return SDM_E_FORMAT;
    for (size_t l = 0; l < a->depth; l++) {
        k->bias[l] = input + input_at[l];
        if (sdm_point_takes_input(a, l)) k->input[l] = k->bias[l] + a->width[l];
    }
    k->last = input + inputs - a->width[a->depth - 1] - 1;
    k->rows = rows_at_once(k->max_width);
    m->info.macs = (double)sdm_point_macs(a) * (double)sdm_grid_count(&m->info.grid);
    return SDM_OK;
}

static void network_free(void *network) { sdm_free(network); }

#define POINT_KIND(text)                                                                           \
    {                                                                                              \
        .name = text, .open = open_network, .dispose = network_free,                               \
        .scratch_bytes = sdm_point_scratch_bytes, .forward = sdm_point_forward, .threaded = true,  \
        .jacobian_scratch_bytes = sdm_point_jacobian_scratch_bytes,                                \
        .jacobian = sdm_point_jacobian, .onnx = sdm_point_onnx                                     \
    }
const sdm_model_kind sdm_kind_deepsdf = POINT_KIND("deepsdf");
const sdm_model_kind sdm_kind_imnet = POINT_KIND("imnet");
