/* Forward, tangent and backward pass of sdmnn through the steps of its plan. */
#include "passes.h"

#include "operators.h"

// a *= b for all channels
static void maps_multiply(const sdm_fmap *g, size_t channels, float *a, const float *b,
                          int n_threads)
{
    (void)n_threads;
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (long c = 0; c < (long)channels; c++) {
        const size_t at = (size_t)c * g->stride;
        for (size_t i = at; i < at + g->count; i++) a[i] *= b[i];
    }
}

// copies the input volume to its feature map and up-samples it to the resolution of level 0
static void volume_enter(const sdmnn_plan *p, const float *volume, float *maps, int n_threads)
{
    sdm_fmap_read(&p->cell, volume, maps + p->volume);
    sdm_upsample_forward(&p->level[0], &p->cell, p->arch.block, 1, maps + p->volume,
                         maps + p->input, n_threads);
}

// Index of the first random number for the drop-out of `step`. Each draw has a contiguous range of
// indices, and within it the steps follow in their order.
static uint64_t first_draw(const sdmnn_plan *p, const sdmnn_step *step, uint64_t draw)
{
    uint64_t before = 0, all = 0;
    for (const sdmnn_step *s = p->steps; s < p->steps + p->n_steps; s++) {
        if (!s->drop) continue;
        const uint64_t n = sdm_dropout_draws(&p->level[s->level], s->conv.out);
        if (s < step) before += n;
        all += n;
    }
    return draw * all + before;
}

void sdm_sdmnn_pass_forward(const sdmnn_plan *p, const sdmnn_layers *w, const float *volume,
                            float *maps, float *slope, const sdmnn_draw *draw, float *map,
                            int n_threads)
{
    volume_enter(p, volume, maps, n_threads);
    for (size_t i = 0; i < p->n_steps; i++) {
        const sdmnn_step *s = &p->steps[i];
        const sdm_fmap *g = &p->level[s->level];
        const float *x = maps + s->from;
        float *y = maps + s->to;
        if (s->op == SDMNN_POOL) {
            sdm_pool_forward(g - 1, g, s->conv.out, x, y, n_threads);
        } else if (s->op == SDMNN_UPSAMPLE) {
            sdm_upsample_forward(g, g + 1, 2, s->conv.out, x, y, n_threads);
        } else {
            const sdm_conv_finish finish = {w->bias[i], s->linear ? -1 : p->arch.activation,
                                            slope && !s->linear ? slope + s->to : NULL};
            w->backend->apply(g, s->conv, w->packed[i], x, finish, y, n_threads);
            if (s->drop && draw && p->arch.dropout > 0)
                sdm_dropout(g, s->conv.out, p->arch.dropout, draw->seed, draw->stream,
                            first_draw(p, s, draw->draw), y, slope + s->to, n_threads);
        }
    }
    if (map) sdm_fmap_write(&p->level[0], maps + p->output, map);
}

void sdm_sdmnn_pass_tangent(const sdmnn_plan *p, const sdmnn_layers *w, const float *maps,
                            const float *slope, const float *volume, float *tangent, float *map,
                            int n_threads)
{
    volume_enter(p, volume, tangent, n_threads);
    for (size_t i = 0; i < p->n_steps; i++) {
        const sdmnn_step *s = &p->steps[i];
        const sdm_fmap *g = &p->level[s->level];
        const float *dx = tangent + s->from;
        float *dy = tangent + s->to;
        if (s->op == SDMNN_POOL) {
            sdm_pool_tangent(g - 1, g, s->conv.out, maps + s->from, dx, dy, n_threads);
        } else if (s->op == SDMNN_UPSAMPLE) {
            sdm_upsample_forward(g, g + 1, 2, s->conv.out, dx, dy, n_threads);
        } else {
            w->backend->apply(g, s->conv, w->packed[i], dx, (sdm_conv_finish){NULL, -1, NULL}, dy,
                              n_threads);
            if (!s->linear) maps_multiply(g, s->conv.out, dy, slope + s->to, n_threads);
        }
    }
    sdm_fmap_write(&p->level[0], tangent + p->output, map);
}

// Each feature map is the input of one step, which in this pass overwrites the gradient by that
// feature map. Only the results of the way down are inputs of two steps: the convolution after the
// concatenation, which comes first in this reverse order and overwrites the gradient, and the
// pooling, which adds to it.
void sdm_sdmnn_pass_backward(const sdmnn_plan *p, const sdmnn_layers *w, const float *maps,
                             const float *slope, const float *map, float *back, float *volume,
                             float *gradient, int n_threads)
{
    sdm_fmap_read(&p->level[0], map, back + p->output);
    for (size_t i = p->n_steps; i-- > 0;) {
        const sdmnn_step *s = &p->steps[i];
        const sdm_fmap *g = &p->level[s->level];
        const float *x = maps + s->from;
        float *dx = back + s->from, *dy = back + s->to;
        if (s->op == SDMNN_POOL) {
            sdm_pool_backward(g - 1, g, s->conv.out, x, dy, dx, n_threads);
        } else if (s->op == SDMNN_UPSAMPLE) {
            sdm_upsample_backward(g, g + 1, 2, s->conv.out, dy, dx, n_threads);
        } else {
            if (!s->linear) maps_multiply(g, s->conv.out, dy, slope + s->to, n_threads);
            float *dw = gradient ? gradient + s->weights : NULL;
            if (dw)
                w->backend->gradient(g, s->conv, x, dy, dw, dw + sdmnn_conv_weights(s), n_threads);
            w->backend->apply(g, sdm_conv_opposite(s->conv), w->transposed[i], dy,
                              (sdm_conv_finish){NULL, -1, NULL}, dx, n_threads);
        }
    }
    sdm_upsample_backward(&p->level[0], &p->cell, p->arch.block, 1, back + p->input,
                          back + p->volume, n_threads);
    sdm_fmap_write(&p->cell, back + p->volume, volume);
}
