/* Forward and backward pass of the perceptron of a point network. */
#include "point_mlp.h"

#include <math.h>
#include <string.h>

#include "data/streams.h"
#include "sdm/internal/kernels.h"
#include "sdm/internal/pod.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/team.h"

enum { SLICE = 32 }; // points that a thread computes at a time

void trainer_point_init(const sdm_point_arch *a, uint64_t seed, float *w)
{
    size_t at = 0;
    for (size_t l = 0; l <= a->depth; l++) {
        const bool last = l == a->depth;
        const size_t width = last ? 1 : a->width[l],
                     k = last ? a->width[l - 1] : sdm_point_inputs(a, l);
        const double sd = sqrt((last ? 0.1 : 2.0) / (double)k);
        for (size_t end = at + width * k; at < end; at++)
            w[at] = (float)(sd * sdm_rng_normal(seed, STREAM_INIT, at));
        memset(w + at, 0, width * sizeof *w);
        at += width;
    }
}

/* The arrays in the workspace: for each hidden layer its output h[B][W_l] and the derivative of its
   activation slope[B][W_l], which the backward pass multiplies by the gradient by h; last[B], the
   derivative of the output function, then the gradient by its argument; delta[2][B][largest W_l],
   gradients by the outputs of two layers in turn. */
typedef struct point_arrays {
    float *h[SDM_POINT_MAX_DEPTH], *slope[SDM_POINT_MAX_DEPTH], *last, *delta[2];
    size_t total;
} point_arrays;

/* Sets the pointers for workspace != NULL; total is the number of floats in any case. */
static point_arrays point_arrays_of(const sdm_point_arch *a, size_t batch, float *workspace)
{
    point_arrays p = {.total = batch};
    size_t widest = 0;
    p.last = workspace;
    for (size_t l = 0; l < a->depth; l++) {
        p.h[l] = workspace ? workspace + p.total : NULL;
        p.slope[l] = workspace ? p.h[l] + batch * a->width[l] : NULL;
        p.total += 2 * batch * a->width[l];
        if (a->width[l] > widest) widest = a->width[l];
    }
    for (int i = 0; i < 2; i++) {
        p.delta[i] = workspace ? workspace + p.total : NULL;
        p.total += batch * widest;
    }
    return p;
}

size_t trainer_point_workspace(const sdm_point_arch *a, size_t batch)
{
    return point_arrays_of(a, batch, NULL).total;
}

/* A loop over the points of this rank. */
typedef struct point_loop {
    const sdm_point_arch *arch;
    sdm_comm_part own;
    size_t width;     // of the layer
    float *h, *slope; // outputs of the layer; slope of its activation, or of the output function
    const float *w;   // weights of the output layer
    float *value;
    const float *delta; // gradient by the outputs of the layer
} point_loop;

static size_t n_slices(const point_loop *l)
{
    return (l->own.end - l->own.first + SLICE - 1) / SLICE;
}

/* The points of slice `index`. */
static sdm_comm_part slice_points(const point_loop *l, size_t index)
{
    const size_t first = l->own.first + index * SLICE;
    return (sdm_comm_part){first, l->own.end - first < SLICE ? l->own.end : first + SLICE};
}

static void activate_slice(void *user, size_t index, int member)
{
    const point_loop *l = user;
    const sdm_comm_part points = slice_points(l, index);
    float *h = l->h + points.first * l->width;
    (void)member;
    sdm_activate(l->arch->activation, (points.end - points.first) * l->width, h, h,
                 l->slope + points.first * l->width);
}

/* Values of the output layer and slopes of its function. */
static void output_slice(void *user, size_t index, int member)
{
    const point_loop *l = user;
    const sdm_point_arch *a = l->arch;
    const sdm_comm_part points = slice_points(l, index);
    (void)member;
    for (size_t i = points.first; i < points.end; i++) {
        float sum = l->w[l->width];
        for (size_t o = 0; o < l->width; o++) sum += l->w[o] * l->h[i * l->width + o];
        const float g = a->tanh_output ? tanhf(sum) : sum;
        l->value[i] = (float)a->scale * g;
        l->slope[i] = (float)a->scale * (a->tanh_output ? 1 - g * g : 1);
    }
}

/* slope *= delta. */
static void deactivate_slice(void *user, size_t index, int member)
{
    const point_loop *l = user;
    const sdm_comm_part points = slice_points(l, index);
    float *restrict slope = l->slope;
    const float *restrict delta = l->delta;
    (void)member;
    for (size_t i = points.first * l->width; i < points.end * l->width; i++)
        slope[i] = delta[i] * slope[i];
}

sdm_status trainer_point_forward(const point_pass *p, float *value, sdm_error *err)
{
    const sdm_point_arch *a = p->arch;
    const point_arrays at = point_arrays_of(a, p->batch, p->workspace);
    const sdm_comm_part own = sdm_comm_own(p->comm, p->batch);
    const size_t n_u = a->n_params + 3, n = own.end - own.first;
    const float *w = p->w;
    // hidden layers
    for (size_t l = 0; l < a->depth; l++) {
        const size_t width = a->width[l], k = sdm_point_inputs(a, l),
                     before = sdm_point_hidden(a, l);
        const float *bias = w + width * k;
        float *h = at.h[l] + own.first * width;
        // h = bias + matrix [output of the layer before, u]
        for (size_t i = 0; i < n; i++) memcpy(h + i * width, bias, width * sizeof *h);
        if (before)
            sdm_gemm(n, width, before, (sdm_view){at.h[l - 1] + own.first * before, before, 1},
                     (sdm_view){w, 1, k}, true, h, width, p->n_threads);
        if (k > before)
            sdm_gemm(n, width, n_u, (sdm_view){p->u + own.first * n_u, n_u, 1},
                     (sdm_view){w + before, 1, k}, true, h, width, p->n_threads);
        w += width * (k + 1);
        point_loop loop = {
            .arch = a, .own = own, .width = width, .h = at.h[l], .slope = at.slope[l]};
        sdm_team_run(p->n_threads, n_slices(&loop), activate_slice, &loop);
    }
    // output layer
    point_loop loop = {.arch = a,
                       .own = own,
                       .width = a->width[a->depth - 1],
                       .h = at.h[a->depth - 1],
                       .slope = at.last,
                       .w = w,
                       .value = value};
    sdm_team_run(p->n_threads, n_slices(&loop), output_slice, &loop);
    return sdm_comm_gather_shares(p->comm, value, p->batch, sizeof *value, err);
}

/* Index of the first weight of layer l; of the output layer for l = depth. */
static size_t layer_offset(const sdm_point_arch *a, size_t l)
{
    size_t at = 0;
    for (size_t i = 0; i < l; i++) at += a->width[i] * (sdm_point_inputs(a, i) + 1);
    return at;
}

/* at->last and at->slope[l] = gradients by the arguments of the output function and of the
 * activations, at the points of this rank. */
static void backward_points(const point_pass *p, const point_arrays *at, const float *slope)
{
    const sdm_point_arch *a = p->arch;
    const sdm_comm_part own = sdm_comm_own(p->comm, p->batch);
    const size_t n = own.end - own.first, last = a->width[a->depth - 1];
    const float *w = p->w + layer_offset(a, a->depth);
    float *d = at->delta[0], *other = at->delta[1];
    // output layer
    for (size_t i = own.first; i < own.end; i++) {
        const float s = slope[i] * at->last[i];
        at->last[i] = s;
        for (size_t o = 0; o < last; o++) d[i * last + o] = s * w[o];
    }
    // hidden layers from the last to the first
    for (size_t l = a->depth; l-- > 0;) {
        const size_t width = a->width[l], k = sdm_point_inputs(a, l),
                     before = sdm_point_hidden(a, l);
        point_loop loop = {.own = own, .width = width, .slope = at->slope[l], .delta = d};
        sdm_team_run(p->n_threads, n_slices(&loop), deactivate_slice, &loop);
        if (l == 0) break;
        sdm_gemm(n, before, width, (sdm_view){at->slope[l] + own.first * width, width, 1},
                 (sdm_view){p->w + layer_offset(a, l), k, 1}, false, other + own.first * before,
                 before, p->n_threads);
        float *swap = d;
        d = other, other = swap;
    }
}

/* Gives all ranks the outputs and gradients at all points. */
static sdm_status gather_points(const point_pass *p, const point_arrays *at, sdm_error *err)
{
    sdm_status s = sdm_comm_gather_shares(p->comm, at->last, p->batch, sizeof *at->last, err);
    for (size_t l = 0; l < p->arch->depth && !s; l++) {
        const size_t bytes = p->arch->width[l] * sizeof *at->last;
        s = sdm_comm_gather_shares(p->comm, at->h[l], p->batch, bytes, err);
        if (!s) s = sdm_comm_gather_shares(p->comm, at->slope[l], p->batch, bytes, err);
    }
    return s;
}

/* Adds the gradient by the weights of the output layer to gradient[H + 1]. */
static void add_output(const point_pass *p, const point_arrays *at, float *gradient)
{
    const size_t last = p->arch->width[p->arch->depth - 1];
    const sdm_comm_part units = sdm_comm_own(p->comm, last);
    for (size_t i = 0; i < p->batch; i++) {
        const float s = at->last[i], *h = at->h[p->arch->depth - 1] + i * last;
        for (size_t o = units.first; o < units.end; o++) gradient[o] += s * h[o];
        gradient[last] += s;
    }
}

/* Adds the gradient by the weights of this rank's units of layer l to those of the layer:
 * dw[W_l][K_l] += d^T [h, u], db[W_l] += sum of d over the batch. */
static void add_layer(const point_pass *p, const point_arrays *at, size_t l, float *dw)
{
    const sdm_point_arch *a = p->arch;
    const size_t width = a->width[l], k = sdm_point_inputs(a, l), before = sdm_point_hidden(a, l),
                 n_u = k - before;
    const sdm_comm_part units = sdm_comm_own(p->comm, width);
    const size_t n = units.end - units.first;
    const float *d = at->slope[l];
    const sdm_view dt = {d + units.first, 1, width};
    float *own = dw + units.first * k, *db = dw + width * k;
    if (before)
        sdm_gemm(n, before, p->batch, dt, (sdm_view){at->h[l - 1], before, 1}, true, own, k,
                 p->n_threads);
    if (n_u)
        sdm_gemm(n, n_u, p->batch, dt, (sdm_view){p->u, n_u, 1}, true, own + before, k,
                 p->n_threads);
    for (size_t i = 0; i < p->batch; i++)
        for (size_t o = units.first; o < units.end; o++) db[o] += d[i * width + o];
}

sdm_status trainer_point_backward(const point_pass *p, const float *slope, float *gradient,
                                  sdm_error *err)
{
    const point_arrays at = point_arrays_of(p->arch, p->batch, p->workspace);
    backward_points(p, &at, slope);
    const sdm_status s = gather_points(p, &at, err);
    if (s) return s;
    add_output(p, &at, gradient + layer_offset(p->arch, p->arch->depth));
    for (size_t l = 0; l < p->arch->depth; l++)
        add_layer(p, &at, l, gradient + layer_offset(p->arch, l));
    return SDM_OK;
}

sdm_status trainer_point_gather(const sdm_point_arch *a, sdm_comm *comm, float *gradient,
                                sdm_error *err)
{
    sdm_status s = SDM_OK;
    for (size_t l = 0; l < a->depth && !s; l++) {
        const size_t width = a->width[l], k = sdm_point_inputs(a, l);
        float *dw = gradient + layer_offset(a, l);
        s = sdm_comm_gather_shares(comm, dw, width, k * sizeof *dw, err);
        if (!s) s = sdm_comm_gather_shares(comm, dw + width * k, width, sizeof *dw, err);
    }
    float *output = gradient + layer_offset(a, a->depth);
    return s ? s
             : sdm_comm_gather_shares(comm, output, a->width[a->depth - 1], sizeof *output, err);
}
