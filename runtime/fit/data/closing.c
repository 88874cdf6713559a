/* Morphological closing of label maps by a ball (Matheron 1975): fills the voxels that no ball
 * lying outside the labels covers. Two exact distance transforms compute it. */
#include <float.h>
#include <math.h>

#include "distance_transform.h"
#include "sdm/fit.h"
#include "sdm/internal/threads.h"
#include "sdm/memory.h"

// the grid extended on every side such that balls fit beside labels at its border; by[3]: number of
// voxels added on each side of each axis
static sdm_grid grid_widen(const sdm_grid *g, double radius, int64_t by[3])
{
    sdm_grid wide = *g;
    for (int a = 0; a < 3; a++) {
        by[a] = (int64_t)fmin(ceil(radius / g->spacing[a]) + 1, (double)INT32_MAX);
        wide.n[a] += 2 * by[a];
    }
    return wide;
}

// index, in the extended grid, of the first voxel of row number `row` of the grid
static size_t row_offset(const sdm_grid *g, const sdm_grid *wide, const int64_t by[3], int64_t row)
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
    // extend the grid so that the balls fit on it
    int64_t by[3];
    sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const sdm_grid wide = grid_widen(grid, radius, by);
    if (sdm_grid_check(&wide, NULL))
        return sdm_fail(err, SDM_E_ARG,
                        "closing by a ball of %g mm: too wide for voxels of %g x %g x %g mm",
                        radius, grid->spacing[0], grid->spacing[1], grid->spacing[2]);
    const size_t n = sdm_grid_count(&wide);
    const int64_t rows = grid->n[1] * grid->n[2];
    const float square =
        // tolerance for the rounding of squared distances in single precision
        (float)(radius * radius * (1 + 4 * (double)FLT_EPSILON));
    float *distance = NULL;
    s = SDM_ALLOC(&distance, n, "distance to labels", err);
    if (s) return s;
    // squared distance of every voxel to the labels
    for (size_t i = 0; i < n; i++) distance[i] = INFINITY;
    for (int64_t row = 0; row < rows; row++) {
        float *to = distance + row_offset(grid, &wide, by, row);
        for (int64_t i = 0; i < grid->n[0]; i++)
            if (values[row * grid->n[0] + i] > 0.5f) to[i] = 0;
    }
    s = sdm_fit_distance_transform(&wide, sdm_threads(n_threads), distance, err);
    for (size_t i = 0; i < n && !s; i++)
        // voxels where a ball outside the labels can be centred
        distance[i] = distance[i] > square ? 0 : INFINITY;
    if (!s) s = sdm_fit_distance_transform(&wide, sdm_threads(n_threads), distance, err);
    for (int64_t row = 0; row < rows && !s; row++) {
        const float *from = distance + row_offset(grid, &wide, by, row);
        for (int64_t i = 0; i < grid->n[0]; i++)
            // no ball covers the voxel
            if (from[i] > square) values[row * grid->n[0] + i] = 1;
    }
    sdm_free(distance);
    return s;
}
