/* Finds cavities by a morphological opening with a ball (Matheron 1975): the union of all balls of
   radius opts->cavity that fit into the inside-like space. Two exact distance transforms compute
   it. */
#include "cavity.h"

#include <math.h>

#include "blur.h"
#include "distance_transform.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

// log density of a mixture of Gaussians at a value
static double log_mixture(const sdm_fit_law *law, size_t n, double value)
{
    double sum = 0, most = -INFINITY, all = 0;
    for (size_t i = 0; i < n; i++) all += law[i].weight;
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < n; i++) {
            const double r = (value - law[i].mean) / law[i].sd;
            const double x = log(law[i].weight / (all * law[i].sd)) - 0.5 * r * r;
            if (pass)
                sum += exp(x - most);
            else
                most = fmax(most, x);
        }
    return most + log(sum);
}

// wall[voxel] = 0 where the voxel is NaN or more likely outside, INFINITY where it is more likely
// inside
static sdm_status walls_find(const sdm_fit_target *t, const sdm_fit_opts *o, int n_threads,
                             float *wall, sdm_error *err)
{
    const size_t n = sdm_grid_count(&t->grid);
    double *packed = NULL, *spare = NULL;
    sdm_status s = SDM_ALLOC(&packed, n, "smoothed image", err);
    if (!s) s = SDM_ALLOC(&spare, n, "smoothed image", err);
    if (!s) {
        // smooth the image; NaN counts as outside
        const sdm_fit_appearance *a = &o->appearance;
        for (size_t i = 0; i < n; i++)
            packed[i] = isnan(t->values[i]) ? a->outside[0].mean : (double)t->values[i];
        sdm_fit_blur(&t->grid, 1, o->blur * o->blur, false, n_threads, &packed, &spare);
#pragma omp parallel for schedule(static) num_threads(n_threads)
        for (size_t i = 0; i < n; i++) {
            const double v = packed[i];
            const bool inside =
                log_mixture(a->inside, a->n_inside, v) > log_mixture(a->outside, a->n_outside, v);
            wall[i] = inside && !isnan(t->values[i]) ? INFINITY : 0;
        }
    }
    sdm_free(packed);
    sdm_free(spare);
    return s;
}

sdm_status sdm_fit_mask_cavities(const sdm_fit_target *target, const sdm_fit_opts *opts,
                                 float **values, size_t *count, double *widest, sdm_error *err)
{
    const size_t n = sdm_grid_count(&target->grid);
    const int n_threads = sdm_threads(opts->n_threads);
    const double square = opts->cavity * opts->cavity;
    float *distance = NULL;
    *values = NULL;
    *count = 0;
    *widest = 0;
    sdm_status s = sdm_fit_blur_check(&target->grid, "blur", opts->blur, opts->blur, err);
    if (!s) s = SDM_ALLOC(&distance, n, "distance to walls", err);
    if (!s) s = SDM_ALLOC(values, n, "image", err);
    if (!s) s = walls_find(target, opts, n_threads, distance, err);
    if (!s) s = sdm_fit_distance_transform(&target->grid, n_threads, distance, err);
    for (size_t i = 0; i < n && !s; i++)
        if (isfinite(distance[i])) *widest = fmax(*widest, sqrt((double)distance[i]));
    for (size_t i = 0; i < n && !s; i++)
        // 0 at the voxels where a ball can be centred
        distance[i] = (double)distance[i] >= square ? 0 : INFINITY;
    if (!s) s = sdm_fit_distance_transform(&target->grid, n_threads, distance, err);
    for (size_t i = 0; i < n && !s; i++) {
        // out: one of these balls covers the voxel
        const bool out = (double)distance[i] < square && !isnan(target->values[i]);
        (*values)[i] = out ? NAN : target->values[i];
        *count += out;
    }
    sdm_free(distance);
    if (s) sdm_free(*values), *values = NULL;
    return s;
}
