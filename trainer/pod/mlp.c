/* Forward and backward pass of the perceptron of the `pod` network. */
#include "mlp.h"

#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/team.h"

/* Number of inputs of layer l. */
static size_t layer_inputs(const sdm_pod_arch *a, size_t l) { return l ? a->width : a->n_inputs; }

/* Index of the first weight of layer l. */
static size_t layer_offset(const sdm_pod_arch *a, size_t l)
{
    size_t n = 0;
    for (size_t i = 0; i < l; i++) n += (layer_inputs(a, i) + 1) * a->width;
    return n;
}

size_t trainer_mlp_count(const sdm_pod_arch *a) { return layer_offset(a, a->depth); }
const float *trainer_mlp_layer(const sdm_pod_arch *a, const float *weights, size_t l)
{
    return weights + layer_offset(a, l);
}
const float *trainer_mlp_bias(const sdm_pod_arch *a, const float *weights, size_t l)
{
    return weights + layer_offset(a, l) + layer_inputs(a, l) * a->width;
}

void trainer_mlp_init(const sdm_pod_arch *a, uint64_t seed, float *weights)
{
    for (size_t l = 0; l < a->depth; l++) {
        const size_t at = layer_offset(a, l), n = layer_inputs(a, l) * a->width;
        const double sd = sqrt(2.0 / (double)layer_inputs(a, l));
        for (size_t i = 0; i < n; i++)
            weights[at + i] = (float)(sd * sdm_rng_normal(seed, STREAM_INIT, at + i));
        memset(weights + at + n, 0, a->width * sizeof *weights);
    }
}

size_t trainer_mlp_workspace(const sdm_pod_arch *a, size_t batch)
{
    return (2 * a->depth + 2) * batch * a->width;
}

/* Rows or columns of a batch that a thread computes at a time. */
enum { ROWS = 16, COLUMNS = 32 };

static size_t min_size(size_t a, size_t b) { return a < b ? a : b; }

/* A loop over rows first .. end - 1 or columns first .. end - 1 of one layer. */
typedef struct layer_loop {
    const sdm_pod_arch *arch;
    size_t batch, first, end;
    const float *bias;
    float *h, *slope; // slope becomes the gradient by the inputs of the activations
    const float *dh;  // gradient by h
    float *db;        // gradient by the bias
} layer_loop;

static size_t n_slices(const layer_loop *l, size_t length)
{
    return (l->end - l->first + length - 1) / length;
}

/* h = activation(h + bias), and its slope, in slice `index` of the rows. */
static void activate_rows(void *user, size_t index, int member)
{
    const layer_loop *l = user;
    const size_t w = l->arch->width, first = l->first + index * ROWS,
                 n = min_size(ROWS, l->end - first);
    float *restrict h = l->h + first * w;
    const float *restrict bias = l->bias;
    (void)member;
    for (size_t i = 0; i < n; i++)
        for (size_t o = 0; o < w; o++) h[i * w + o] += bias[o];
    sdm_activate(l->arch->activation, n * w, h, h, l->slope + first * w);
}

/* slope *= dh in slice `index` of the rows. */
static void deactivate_rows(void *user, size_t index, int member)
{
    const layer_loop *l = user;
    const size_t w = l->arch->width, first = l->first + index * ROWS,
                 n = min_size(ROWS, l->end - first);
    float *restrict slope = l->slope + first * w;
    const float *restrict dh = l->dh + first * w;
    (void)member;
    for (size_t i = 0; i < n * w; i++) slope[i] = dh[i] * slope[i];
}

/* db = sums over the batch in slice `index` of the columns. */
static void sum_columns(void *user, size_t index, int member)
{
    const layer_loop *l = user;
    const size_t w = l->arch->width, first = l->first + index * COLUMNS,
                 n = min_size(COLUMNS, l->end - first);
    float sum[COLUMNS] = {0};
    (void)member;
    for (size_t i = 0; i < l->batch; i++)
        for (size_t o = 0; o < n; o++) sum[o] += l->slope[i * w + first + o];
    memcpy(l->db + first, sum, n * sizeof *sum);
}

/* The workspace holds h[depth][B][W], slope[depth][B][W] (derivatives of the activations, which the
   backward pass replaces by the gradients by their inputs) and two buffers [B][W]. */
static float *outputs_of(const sdm_pod_arch *a, size_t batch, float *workspace, size_t l)
{
    return workspace + l * batch * a->width;
}
static float *slopes_of(const sdm_pod_arch *a, size_t batch, float *workspace, size_t l)
{
    return workspace + (a->depth + l) * batch * a->width;
}

const float *trainer_mlp_forward_rows(const sdm_pod_arch *a, const float *weights, size_t batch,
                                      sdm_comm_part rows, const float *x, float *workspace,
                                      int n_threads)
{
    const size_t w = a->width;
    for (size_t l = 0; l < a->depth; l++) {
        const size_t k = layer_inputs(a, l);
        layer_loop loop = {.arch = a,
                           .batch = batch,
                           .first = rows.first,
                           .end = rows.end,
                           .bias = trainer_mlp_bias(a, weights, l),
                           .h = outputs_of(a, batch, workspace, l),
                           .slope = slopes_of(a, batch, workspace, l)};
        sdm_gemm(rows.end - rows.first, w, k, (sdm_view){x + rows.first * k, k, 1},
                 (sdm_view){trainer_mlp_layer(a, weights, l), 1, k}, false, loop.h + rows.first * w,
                 w, n_threads);
        sdm_team_run(n_threads, n_slices(&loop, ROWS), activate_rows, &loop);
        x = loop.h;
    }
    return x;
}

void trainer_mlp_backward_rows(const sdm_pod_arch *a, const float *weights, size_t batch,
                               sdm_comm_part rows, float *workspace, const float *dh, int n_threads)
{
    const size_t w = a->width, first = rows.first * w;
    // two buffers in turn, [B][W]
    float *below = slopes_of(a, batch, workspace, a->depth), *other = below + batch * w;
    for (size_t l = a->depth; l-- > 0;) {
        layer_loop loop = {.arch = a,
                           .batch = batch,
                           .first = rows.first,
                           .end = rows.end,
                           .slope = slopes_of(a, batch, workspace, l),
                           .dh = dh};
        sdm_team_run(n_threads, n_slices(&loop, ROWS), deactivate_rows, &loop);
        if (l == 0) break;
        // gradient by the outputs of the layer below
        sdm_gemm(rows.end - rows.first, w, w, (sdm_view){loop.slope + first, w, 1},
                 (sdm_view){trainer_mlp_layer(a, weights, l), w, 1}, false, below + first, w,
                 n_threads);
        dh = below;
        float *const swap = below;
        below = other, other = swap;
    }
}

void trainer_mlp_gradient_units(const sdm_pod_arch *a, size_t batch, sdm_comm_part units,
                                const float *x, float *workspace, float *gradient, int n_threads)
{
    const size_t w = a->width;
    for (size_t l = a->depth; l-- > 0;) {
        const float *in = l ? outputs_of(a, batch, workspace, l - 1) : x;
        const size_t k = layer_inputs(a, l);
        float *dw = gradient + layer_offset(a, l);
        layer_loop loop = {.arch = a,
                           .batch = batch,
                           .first = units.first,
                           .end = units.end,
                           .slope = slopes_of(a, batch, workspace, l),
                           .db = dw + k * w};
        sdm_team_run(n_threads, n_slices(&loop, COLUMNS), sum_columns, &loop);
        sdm_gemm(units.end - units.first, k, batch, (sdm_view){loop.slope + units.first, 1, w},
                 (sdm_view){in, k, 1}, false, dw + units.first * k, k, n_threads);
    }
}

const float *trainer_mlp_forward(const sdm_pod_arch *a, const float *weights, size_t batch,
                                 const float *x, float *workspace, int n_threads)
{
    return trainer_mlp_forward_rows(a, weights, batch, (sdm_comm_part){0, batch}, x, workspace,
                                    n_threads);
}

void trainer_mlp_backward(const sdm_pod_arch *a, const float *weights, size_t batch, const float *x,
                          float *workspace, const float *dh, float *gradient, int n_threads)
{
    trainer_mlp_backward_rows(a, weights, batch, (sdm_comm_part){0, batch}, workspace, dh,
                              n_threads);
    trainer_mlp_gradient_units(a, batch, (sdm_comm_part){0, a->width}, x, workspace, gradient,
                               n_threads);
}

sdm_status trainer_mlp_gather_rows(const sdm_pod_arch *a, sdm_comm *comm, size_t batch,
                                   float *workspace, sdm_error *err)
{
    sdm_status s = SDM_OK;
    // h and slope of all layers lie one after the other
    for (size_t l = 0; l < 2 * a->depth && !s; l++)
        s = sdm_comm_gather_shares(comm, outputs_of(a, batch, workspace, l), batch,
                                   a->width * sizeof *workspace, err);
    return s;
}

sdm_status trainer_mlp_gather_units(const sdm_pod_arch *a, sdm_comm *comm, float *gradient,
                                    sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t l = 0; l < a->depth && !s; l++) {
        const size_t k = layer_inputs(a, l);
        float *dw = gradient + layer_offset(a, l);
        s = sdm_comm_gather_shares(comm, dw, a->width, k * sizeof *dw, err);
        if (!s) s = sdm_comm_gather_shares(comm, dw + k * a->width, a->width, sizeof *dw, err);
    }
    return s;
}
