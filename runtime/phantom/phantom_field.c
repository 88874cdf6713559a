/* Random fields of phantoms: white noise, smoothed, of variance 1. */
#include <math.h>
#include <string.h>

#include "phantom_parts.h"
#include "sdm/internal/heap.h"
#include "sdm/internal/rng.h"
#include "sdm/internal/threads.h"

/* Scales the weights so that their squares add up to 1: filtering white noise then keeps its
   variance. */
static void filter_normalise(phantom_filter *f)
{
    double squares = 0;
    for (size_t j = 0; j < f->n; j++) squares += (double)f->weight[j] * (double)f->weight[j];
    for (size_t j = 0; j < f->n; j++) f->weight[j] = (float)((double)f->weight[j] / sqrt(squares));
}

/* Smooths field[size[2]][size[1]][size[0]] in place; the result [n[2]][n[1]][n[0]] lies at its
   beginning. */
static void field_smooth(const phantom_filter f[3], const size_t size[3], const size_t n[3],
                         int threads, float *field)
{
    const size_t row = size[0], plane = size[0] * size[1];
    (void)threads; // unused without OpenMP
#pragma omp parallel for num_threads(threads) schedule(static)
    for (size_t k = 0; k < size[2]; k++) {
        phantom_filter_rows(&f[1], field + k * plane, n[1], row, row);
        for (size_t j = 0; j < n[1]; j++)
            phantom_filter_line(&f[0], field + k * plane + j * row, n[0]);
    }
#pragma omp parallel for num_threads(threads) schedule(static)
    for (size_t j = 0; j < n[1]; j++)
        phantom_filter_rows(&f[2], field + j * row, n[2], plane, n[0]);
    // close the gaps between rows and planes
    for (size_t k = 0; k < n[2]; k++)
        for (size_t j = 0; j < n[1]; j++)
            memmove(field + (k * n[1] + j) * n[0], field + k * plane + j * row,
                    n[0] * sizeof *field);
}

sdm_status phantom_field_make(const sdm_grid *grid, const double sigma[3],
                              const sdm_phantom_opts *o, uint64_t stream, float **out,
                              sdm_error *err)
{
    const int threads = sdm_threads(o->n_threads);
    phantom_filter f[3] = {{0}};
    size_t n[3], size[3], count = 1;
    float *field = NULL;
    sdm_status s = SDM_OK;
    // filters, and the size of the noise with its margins
    for (int a = 0; a < 3 && !s; a++) {
        n[a] = (size_t)grid->n[a];
        s = phantom_filter_make(sigma[a] / grid->spacing[a], 1, &f[a], err);
        if (s) break;
        filter_normalise(&f[a]);
        size[a] = phantom_filter_samples(&f[a], n[a]);
        s = sdm_mul(count, size[a], &count, err);
    }
    if (!s) s = SDM_ALLOC(&field, count, "random field", err);
    if (!s) {
/* white noise, numbered by voxel */
#pragma omp parallel for num_threads(threads) schedule(static)
        for (size_t row = 0; row < size[1] * size[2]; row++) {
            if (phantom_check_cancelled(o, NULL)) continue;
            for (size_t i = row * size[0]; i < (row + 1) * size[0]; i++)
                field[i] = (float)sdm_rng_normal(o->seed, stream, i);
        }
        s = phantom_check_cancelled(o, err);
    }
    if (!s) field_smooth(f, size, n, threads, field);
    for (int a = 0; a < 3; a++) phantom_filter_dispose(&f[a]);
    if (s) sdm_free(field);
    *out = s ? NULL : field;
    return s;
}
