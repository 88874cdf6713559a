/* Sizes of a point network: numbers of weights and multiply-adds, and sizes of the two sections of
   its file. */
#include "point_internal.h"
#include "sdm/internal/kernels.h"

size_t sdm_point_count(const sdm_point_arch *a)
{
    size_t n = a->width[a->depth - 1] + 1;
    for (size_t l = 0; l < a->depth; l++) n += a->width[l] * (sdm_point_inputs(a, l) + 1);
    return n;
}

size_t sdm_point_macs(const sdm_point_arch *a)
{
    size_t n = a->width[a->depth - 1];
    for (size_t l = 0; l < a->depth; l++) n += a->width[l] * sdm_point_inputs(a, l);
    return n;
}

size_t sdm_point_hidden_count(const sdm_point_arch *a, size_t *at)
{
    size_t n = 0;
    for (size_t l = 0; l < a->depth; l++) {
        if (at) at[l] = n;
        if (l) n += sdm_panel_count(a->width[l], a->width[l - 1]);
    }
    return n;
}

size_t sdm_point_input_count(const sdm_point_arch *a, size_t *at)
{
    size_t n = 0;
    for (size_t l = 0; l < a->depth; l++) {
        if (at) at[l] = n;
        n += a->width[l] * (1 + (sdm_point_takes_input(a, l) ? a->n_params + 3 : 0));
    }
    return n + a->width[a->depth - 1] + 1;
}
