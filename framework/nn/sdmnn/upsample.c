/* Nearest-neighbour up-sampling of feature maps, and its transpose. */
#include <string.h>

#include "operators.h"

static void upsample_channel(const sdm_fmap *g, const sdm_fmap *h, size_t factor, const float *x,
                             float *y)
{
    for (size_t k = 0; k < g->n[2]; k++) {
        for (size_t j = 0; j < g->n[1]; j++) {
            const float *from = x + k / factor * h->plane + j / factor * h->row;
            float *to = y + k * g->plane + j * g->row;
            for (size_t i = 0; i < h->n[0]; i++, to += factor)
                for (size_t a = 0; a < factor && i * factor + a < g->n[0]; a++) to[a] = from[i];
        }
    }
    sdm_fmap_clear_pads(g, 0, g->count, y);
}

static void sum_channel(const sdm_fmap *g, const sdm_fmap *h, size_t factor, const float *dy,
                        float *dx)
{
    memset(dx, 0, h->count * sizeof *dx);
    for (size_t k = 0; k < g->n[2]; k++) {
        for (size_t j = 0; j < g->n[1]; j++) {
            const float *from = dy + k * g->plane + j * g->row;
            float *to = dx + k / factor * h->plane + j / factor * h->row;
            for (size_t i = 0; i < h->n[0]; i++, from += factor)
                for (size_t a = 0; a < factor && i * factor + a < g->n[0]; a++) to[i] += from[a];
        }
    }
}

void sdm_upsample_forward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                          const float *x, float *y, int n_threads)
{
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (long c = 0; c < (long)channels; c++)
        upsample_channel(g, h, factor, x + (size_t)c * h->stride, y + (size_t)c * g->stride);
}

void sdm_upsample_backward(const sdm_fmap *g, const sdm_fmap *h, size_t factor, size_t channels,
                           const float *dy, float *dx, int n_threads)
{
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (long c = 0; c < (long)channels; c++)
        sum_channel(g, h, factor, dy + (size_t)c * g->stride, dx + (size_t)c * h->stride);
}
