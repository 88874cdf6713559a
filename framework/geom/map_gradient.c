/* The gradient of a map by finite differences. */
#include "sdm/map.h"

#include "sdm/internal/threads.h"

/* Finite difference with respect to the index i on an axis of n voxels; `at` points to voxel i, and
   neighbours are `step` floats apart. */
static double difference(const float *at, int64_t i, int64_t n, int64_t step)
{
    if (n < 2) return 0;
    if (i > 0 && i < n - 1) return 0.5 * ((double)at[step] - (double)at[-step]);
    const int64_t in = i ? -step : step; // towards the inside of the grid
    const double sign = i ? -1 : 1, first = (double)at[in] - (double)at[0];
    return n == 2 ? sign * first
                  : sign * (1.5 * first - 0.5 * ((double)at[2 * in] - (double)at[in]));
}

/* Writes the gradient at all voxels of row (j, k). */
static void gradient_row(const sdm_grid *g, const float *values, int64_t j, int64_t k,
                         float *gradient)
{
    const int64_t nx = g->n[0], ny = g->n[1], n = nx * ny * g->n[2], row = (k * ny + j) * nx;
    const int64_t place[3] = {0, j, k}, step[3] = {1, nx, nx * ny};
    for (int64_t i = 0; i < nx; i++) {
        double d[3];
        for (int a = 0; a < 3; a++)
            d[a] = difference(values + row + i, a ? place[a] : i, g->n[a], step[a]) / g->spacing[a];
        // index axes to world axes: the inverse transpose of dir, which is dir since it is
        // orthonormal
        for (int a = 0; a < 3; a++)
            gradient[a * n + row + i] =
                (float)(g->dir[3 * a] * d[0] + g->dir[3 * a + 1] * d[1] + g->dir[3 * a + 2] * d[2]);
    }
}

sdm_status sdm_map_gradient(const sdm_grid *grid, const float *values, int n_threads,
                            float *gradient, sdm_error *err)
{
    if (!grid || !values || !gradient)
        return sdm_fail(err, SDM_E_ARG,
                        "gradient: a grid, a map and a place for the result are needed");
    if (n_threads < 0)
        return sdm_fail(err, SDM_E_ARG, "%d threads, need 0 (all) or more", n_threads);
    const sdm_status s = sdm_grid_check(grid, err);
    if (s) return s;
    const int64_t ny = grid->n[1], rows = ny * grid->n[2];
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (int64_t r = 0; r < rows; r++) gradient_row(grid, values, r % ny, r / ny, gradient);
    return SDM_OK;
}
