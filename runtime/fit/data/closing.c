/* Closing by a ball: what no ball of a radius outside of the labels reaches (Matheron 1975),
 * through two exact distance transforms. */
#include <float.h>
#include <math.h>

#include "sdm/fit.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"
#include "transform.h"

// the grid with so many voxels on every side that balls beside the labels find room
static sdm_grid widen(const sdm_grid *g, double radius, int64_t by[3])
{
    sdm_grid wide = *g;
    for (int a = 0; a < 3; a++) {
        by[a] = (int64_t)fmin(ceil(radius / g->spacing[a]) + 1, (double)INT32_MAX);
        wide.n[a] += 2 * by[a];
    }
    return wide;
}

// place in the wide grid of the first voxel of a row
static size_t place_of(const sdm_grid *g, const sdm_grid *wide, const int64_t by[3], int64_t row)
{
    const int64_t j = row % g->n[1] + by[1], k = row / g->n[1] + by[2];
    return (size_t)((k * wide->n[1] + j) * wide->n[0] + by[0]);
}

sdm_status sdm_fit_close_labels(const sdm_grid *grid, double radius, int n_threads, float *values,
                                sdm_error *err)
{
    if (!grid || !values) return sdm_fail(err, SDM_E_ARG, "closing: a grid and labels are needed");
    if (!(radius > 0))
        return sdm_fail(err, SDM_E_ARG, "closing by a ball of %g mm, need a radius above 0",
                        radius);
    int64_t by[3];
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const sdm_grid wide = widen(grid, radius, by);
    if (sdm_grid_check(&wide, NULL))
        return sdm_fail(err, SDM_E_ARG,
                        "closing by a ball of %g mm: too wide for voxels of %g x %g x %g mm",
                        radius, grid->spacing[0], grid->spacing[1], grid->spacing[2]);
    const size_t n = sdm_grid_count(&wide);
    const int64_t rows = grid->n[1] * grid->n[2];
    const float square =
        (float)(radius * radius * (1 + 4 * (double)FLT_EPSILON)); // distances are rounded
    float *distance = NULL;
    s = SDM_ALLOC(&distance, n, "distance to labels", err);
    if (s) return s;
    for (size_t i = 0; i < n; i++) distance[i] = INFINITY;
    for (int64_t row = 0; row < rows; row++) {
        float *to = distance + place_of(grid, &wide, by, row);
        for (int64_t i = 0; i < grid->n[0]; i++)
            if (values[row * grid->n[0] + i] > 0.5f) to[i] = 0;
    }
    s = sdm_fit_transform(&wide, sdm_threads(n_threads), distance, err);
    for (size_t i = 0; i < n && !s; i++)
        distance[i] = distance[i] > square ? 0 : INFINITY; // centres of balls outside
    if (!s) s = sdm_fit_transform(&wide, sdm_threads(n_threads), distance, err);
    for (int64_t row = 0; row < rows && !s; row++) {
        const float *from = distance + place_of(grid, &wide, by, row);
        for (int64_t i = 0; i < grid->n[0]; i++)
            if (from[i] > square) values[row * grid->n[0] + i] = 1;
    }
    sdm_free(distance);
    return s;
}
