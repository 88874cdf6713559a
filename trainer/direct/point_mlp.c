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
   activation slope[B][W_l]; last[B], the derivative of the output function; delta[2][B][largest
   W_l], gradients of two layers in turn. */
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

/* A loop over the points of a batch. */
typedef struct point_loop {
    const sdm_point_arch *arch;
    size_t batch, width; // points; width of the layer
    float *h, *slope;    // outputs of the layer; slope of its activation, or of the output function
    const float *w;      // weights of the output layer
    float *value;
    float *delta; // gradient by the outputs of the layer
} point_loop;

/* Number of points in the slice that begins at point `first`. */
static size_t slice_points(const point_loop *l, size_t first)
{
    return l->batch - first < SLICE ? l->batch - first : SLICE;
}

static void activate_slice(void *user, size_t index, int member)
{
    const point_loop *l = user;
    const size_t first = index * SLICE, n = slice_points(l, first) * l->width;
    float *h = l->h + first * l->width;
    (void)member;
    sdm_activate(l->arch->activation, n, h, h, l->slope + first * l->width);
}

/* Values of the output layer and slopes of its function. */
static void output_slice(void *user, size_t index, int member)
{
    const point_loop *l = user;
    const sdm_point_arch *a = l->arch;
    const size_t first = index * SLICE, n = slice_points(l, first);
    (void)member;
    for (size_t i = first; i < first + n; i++) {
        float sum = l->w[l->width];
        for (size_t o = 0; o < l->width; o++) sum += l->w[o] * l->h[i * l->width + o];
        const float g = a->tanh_output ? tanhf(sum) : sum;
        l->value[i] = (float)a->scale * g;
        l->slope[i] = (float)a->scale * (a->tanh_output ? 1 - g * g : 1);
    }
}

/* delta *= slope. */
static void deactivate_slice(void *user, size_t index, int member)
{
    const point_loop *l = user;
    const size_t first = index * SLICE * l->width, n = slice_points(l, index * SLICE) * l->width;
    (void)member;
    for (size_t i = first; i < first + n; i++) l->delta[i] *= l->slope[i];
}

void trainer_point_forward(const sdm_point_arch *a, const float *w, size_t batch, const float *u,
                           float *workspace, float *value, int n_threads)
{
    const point_arrays p = point_arrays_of(a, batch, workspace);
    const size_t n_u = a->n_params + 3, slices = (batch + SLICE - 1) / SLICE;
    // hidden layers
    for (size_t l = 0; l < a->depth; l++) {
        const size_t width = a->width[l], k = sdm_point_inputs(a, l),
                     before = sdm_point_hidden(a, l);
        const float *bias = w + width * k;
        float *h = p.h[l];
        // h = bias + matrix [output of the layer before, u]
        for (size_t i = 0; i < batch; i++) memcpy(h + i * width, bias, width * sizeof *h);
        if (before)
            sdm_gemm(batch, width, before, (sdm_view){p.h[l - 1], before, 1}, (sdm_view){w, 1, k},
                     true, h, width, n_threads);
        if (k > before)
            sdm_gemm(batch, width, n_u, (sdm_view){u, n_u, 1}, (sdm_view){w + before, 1, k}, true,
                     h, width, n_threads);
        w += width * (k + 1);
        point_loop loop = {.arch = a, .batch = batch, .width = width, .h = h, .slope = p.slope[l]};
        sdm_team_run(n_threads, slices, activate_slice, &loop);
    }
    // output layer
    point_loop loop = {.arch = a,
                       .batch = batch,
                       .width = a->width[a->depth - 1],
                       .h = p.h[a->depth - 1],
                       .slope = p.last,
                       .w = w,
                       .value = value};
    sdm_team_run(n_threads, slices, output_slice, &loop);
}

/* Adds the gradient of one layer: dw[width][k] += d^T [h, u], db[width] += sum of d over the batch.
   before, n_u: columns of h and u, 0 if the layer does not have them. */
static void layer_gradient(size_t batch, size_t width, const float *d, size_t before,
                           const float *h, size_t n_u, const float *u, float *dw, int n_threads)
{
    const size_t k = before + n_u;
    const sdm_view dt = {d, 1, width};
    if (before)
        sdm_gemm(width, before, batch, dt, (sdm_view){h, before, 1}, true, dw, k, n_threads);
    if (n_u)
        sdm_gemm(width, n_u, batch, dt, (sdm_view){u, n_u, 1}, true, dw + before, k, n_threads);
    float *db = dw + width * k;
    for (size_t i = 0; i < batch; i++)
        for (size_t o = 0; o < width; o++) db[o] += d[i * width + o];
}

void trainer_point_backward(const sdm_point_arch *a, const float *w, size_t batch, const float *u,
                            float *workspace, const float *slope, float *gradient, int n_threads)
{
    point_arrays p = point_arrays_of(a, batch, workspace);
    const size_t last = a->width[a->depth - 1];
    size_t at = sdm_point_count(a) - last - 1; // first weight of the output layer
    float *d = p.delta[0], *other = p.delta[1];
    // output layer
    for (size_t i = 0; i < batch; i++) {
        const float s = slope[i] * p.last[i];
        const float *h = p.h[a->depth - 1] + i * last;
        for (size_t o = 0; o < last; o++) {
            gradient[at + o] += s * h[o];
            d[i * last + o] = s * w[at + o];
        }
        gradient[at + last] += s;
    }
    // hidden layers from the last to the first
    for (size_t l = a->depth; l-- > 0;) {
        const size_t width = a->width[l], k = sdm_point_inputs(a, l),
                     before = sdm_point_hidden(a, l);
        at -= width * (k + 1);
        point_loop loop = {.batch = batch, .width = width, .slope = p.slope[l], .delta = d};
        sdm_team_run(n_threads, (batch + SLICE - 1) / SLICE, deactivate_slice, &loop);
        layer_gradient(batch, width, d, before, l ? p.h[l - 1] : NULL, k - before, u, gradient + at,
                       n_threads);
        if (l == 0) break;
        sdm_gemm(batch, before, width, (sdm_view){d, width, 1}, (sdm_view){w + at, k, 1}, false,
                 other, before, n_threads);
        float *swap = d;
        d = other, other = swap;
    }
}
