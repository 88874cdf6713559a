/* Max pooling of feature maps by 2. */
#include "operators.h"

// Index of the maximum of the window of w[0] x w[1] x w[2] voxels whose first voxel is x[at].
static size_t largest(const sdm_fmap *g, const float *x, size_t at, const size_t w[3])
{
    size_t best = at;
    for (size_t c = 0; c < w[2]; c++)
        for (size_t b = 0; b < w[1]; b++)
            for (size_t a = 0; a < w[0]; a++) {
                const size_t i = at + c * g->plane + b * g->row + a;
                if (x[i] > x[best]) best = i;
            }
    return best;
}

// Processes one channel. For each window, with v the voxel of its maximum of x: to[window] =
// from[v], or with `back` to[v] += from[window].
static void pool_windows(const sdm_fmap *g, const sdm_fmap *h, const float *x, const float *from,
                         float *to, int back)
{
    size_t w[3];
    for (size_t k = 0; k < h->n[2]; k++) {
        w[2] = 2 * k + 1 < g->n[2] ? 2 : 1;
        for (size_t j = 0; j < h->n[1]; j++) {
            w[1] = 2 * j + 1 < g->n[1] ? 2 : 1;
            for (size_t i = 0; i < h->n[0]; i++) {
                w[0] = 2 * i + 1 < g->n[0] ? 2 : 1;
                const size_t small = k * h->plane + j * h->row + i;
                const size_t large = largest(g, x, 2 * (k * g->plane + j * g->row + i), w);
                if (back)
                    to[large] += from[small];
                else
                    to[small] = from[large];
            }
        }
    }
}

void sdm_pool_tangent(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      const float *dx, float *dy, int n_threads)
{
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (long c = 0; c < (long)channels; c++) {
        float *out = dy + (size_t)c * h->stride;
        pool_windows(g, h, x + (size_t)c * g->stride, dx + (size_t)c * g->stride, out, 0);
        sdm_fmap_clear_pads(h, 0, h->count, out);
    }
}

void sdm_pool_forward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                      float *y, int n_threads)
{
    sdm_pool_tangent(g, h, channels, x, x, y, n_threads);
}

void sdm_pool_backward(const sdm_fmap *g, const sdm_fmap *h, size_t channels, const float *x,
                       const float *dy, float *dx, int n_threads)
{
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (long c = 0; c < (long)channels; c++)
        pool_windows(g, h, x + (size_t)c * g->stride, dy + (size_t)c * h->stride,
                     dx + (size_t)c * g->stride, 1);
}
