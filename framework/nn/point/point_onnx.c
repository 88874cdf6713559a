/* A point network as ONNX operators. The voxels of one plane z pass through the layers together: a
   loop over the planes keeps the memory of a map small. Letters as in sdm/internal/point_network.h;
   V voxels of a plane. */
#include "point_internal.h"
#include "sdm/internal/kernels.h"

// row `input` of the part of W_l that multiplies h_(l-1), transposed: [W_(l-1)][W_l]
static void fill_hidden(const void *user, size_t input, float *to)
{
    const sdm_onnx_layer *l = user;
    const point_network *k = l->network;
    const size_t at = k->hidden_at[l->layer], before = k->arch.width[l->layer - 1];
    for (size_t o = 0; o < k->arch.width[l->layer]; o++)
        to[o] = sdm_weight_at(k->hidden, k->half, at + sdm_panel_index(before, o, input));
}

// q[V][3] of the voxels of a plane
static void fill_coordinates(const void *user, size_t z, float *to)
{
    const sdm_model *m = user;
    const point_network *k = m->network;
    const size_t n = (size_t)(m->info.grid.n[0] * m->info.grid.n[1]);
    sdm_point_coordinates(&m->info.grid, &k->arch, z * n, n, to);
}

// The bias of a layer, with the part of W_l u that comes from the parameters: [N][1][W_l] or [W_l]
static sdm_onnx_value bias(const point_network *k, sdm_onnx *g, size_t l, sdm_onnx_value x)
{
    const size_t width = k->arch.width[l];
    const sdm_onnx_value b = sdm_onnx_floats(g, "bias", 1, &width, k->bias[l]);
    if (!k->input[l]) return b;
    const sdm_onnx_value w =
        sdm_onnx_floats(g, "parameters", 2, (const size_t[]){k->arch.n_params, width}, k->input[l]);
    return sdm_onnx_reshape(g, sdm_onnx_node3(g, "Gemm", x, w, b), 3,
                            (const int64_t[]){-1, 1, (int64_t)width});
}

// values of a plane, [N][V], from the outputs of the last hidden layer
static sdm_onnx_value output(const point_network *k, sdm_onnx *g, size_t voxels, sdm_onnx_value h)
{
    const sdm_point_arch *a = &k->arch;
    const size_t width = a->width[a->depth - 1], one = 1;
    h = sdm_onnx_node2(g, "MatMul", h,
                       sdm_onnx_floats(g, "last layer", 2, (const size_t[]){width, 1}, k->last));
    h = sdm_onnx_node2(g, "Add", h, sdm_onnx_floats(g, "bias", 1, &one, k->last + width));
    if (a->tanh_output) h = sdm_onnx_node1(g, "Tanh", h);
    h = sdm_onnx_node2(g, "Mul", h, sdm_onnx_scalar(g, a->scale));
    return sdm_onnx_reshape(g, h, 2, (const int64_t[]){-1, (int64_t)voxels});
}

sdm_onnx_value sdm_point_onnx(const sdm_model *m, sdm_onnx *g, sdm_onnx_value x)
{
    const point_network *k = m->network;
    const sdm_point_arch *a = &k->arch;
    const size_t nz = (size_t)m->info.grid.n[2],
                 voxels = (size_t)(m->info.grid.n[0] * m->info.grid.n[1]);
    sdm_onnx_value biases[SDM_POINT_MAX_DEPTH];
    for (size_t l = 0; l < a->depth; l++) biases[l] = bias(k, g, l, x);

    const sdm_onnx_value q = sdm_onnx_loop_begin(
        g,
        sdm_onnx_weights(g, "coordinates", 3, (const size_t[]){nz, voxels, 3}, fill_coordinates, m),
        2, (const size_t[]){voxels, 3});
    sdm_onnx_value h = 0;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t width = a->width[l];
        sdm_onnx_value sum = biases[l];
        if (k->input[l])
            sum = sdm_onnx_node2(
                g, "Add", sum,
                sdm_onnx_node2(g, "MatMul", q,
                               sdm_onnx_floats(g, "coordinates", 2, (const size_t[]){3, width},
                                               k->input[l] + a->n_params * width)));
        if (l) {
            const sdm_onnx_value w =
                sdm_onnx_layer_weights(g, a->width[l - 1], width, fill_hidden, k, l);
            sum = sdm_onnx_node2(g, "Add", sum, sdm_onnx_node2(g, "MatMul", h, w));
        }
        h = sdm_onnx_activate(g, a->activation, sum);
    }
    return sdm_model_onnx_maps(
        m, g, sdm_onnx_loop_end(g, output(k, g, voxels, h), 2, (const size_t[]){0, voxels}, 1));
}
