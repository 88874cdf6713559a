/* A pattern in every rotation of a set, for fast scores at boxes of an image. */
#include "turned_pattern.h"

#include <math.h>

#include "sdm/internal/mat3.h"
#include "sdm/memory.h"
#include "turn_set.h"

sdm_status sdm_fit_turned_make(const fit_pattern *p, const fit_likeness *l, size_t n_turns,
                               size_t stride, fit_turned *out, sdm_error *err)
{
    *out = (fit_turned){.n_inside = (p->n_inside + stride - 1) / stride,
                        .n = (p->n + stride - 1) / stride};
    const sdm_status s = SDM_ALLOC(&out->offset, n_turns * out->n, "rotated pattern", err);
    int32_t *to = out->offset;
    for (size_t r = 0; r < n_turns && !s; r++) {
        double turn[9];
        sdm_fit_turn(SDM_FIT_TURNS_SPHERE, r, n_turns, turn);
        for (int i = 0; i < 9; i++) turn[i] /= l->edge[i / 3];
        for (size_t i = 0; i < p->n; i += stride) {
            double x[3];
            m3_apply(turn, p->points[i], x);
            *to++ = (int32_t)((llrint(x[2]) * l->n[1] + llrint(x[1])) * l->n[0] + llrint(x[0]));
        }
    }
    return s;
}

void sdm_fit_turned_dispose(fit_turned *t)
{
    sdm_free(t->offset);
    *t = (fit_turned){0};
}

double sdm_fit_turned_score(const fit_turned *t, size_t r, const uint8_t *at)
{
    const int32_t *offset = t->offset + r * t->n;
    uint32_t inside = 0, around = 0;
    for (size_t i = 0; i < t->n_inside; i++) inside += at[offset[i]];
    for (size_t i = t->n_inside; i < t->n; i++) around += at[offset[i]];
    return ((double)inside / (double)t->n_inside - (double)around / (double)(t->n - t->n_inside)) /
           255;
}
