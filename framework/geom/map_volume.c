/* The volume of a shape from its map. */
#include <math.h>

#include "sdm/internal/threads.h"
#include "sdm/map.h"
#include "sdm/memory.h"

/* Half width of the smoothed step, in voxels. */
#define HALF_WIDTH 1.5

/* Share of the inside at the signed distance r, in units of the half width: 1 - H(r) with the
   smoothed step H of the kernel 105/64 (1 - 5 r^2 + 7 r^4 - 3 r^6) on -1 .. 1. */
static double inside(double r)
{
    if (r <= -1) return 1;
    if (r >= 1) return 0;
    const double s = r * r;
    return 0.5 - 105.0 / 64 * r * (1 + s * (-5.0 / 3 + s * (7.0 / 5 - s * 3.0 / 7)));
}

/* The derivative of inside(r). */
static double inside_slope(double r)
{
    if (!(fabs(r) < 1)) return 0;
    const double s = r * r;
    return -105.0 / 64 * (1 + s * (-5 + s * (7 - s * 3)));
}

static sdm_status check(const sdm_grid *grid, const float *values, const void *result,
                        int n_threads, sdm_error *err)
{
    if (!grid || !values || !result)
        return sdm_fail(err, SDM_E_ARG,
                        "volume: a grid, a map and a place for the result are needed");
    if (n_threads < 0)
        return sdm_fail(err, SDM_E_ARG, "%d threads, need 0 (all) or more", n_threads);
    return sdm_grid_check(grid, err);
}

/* Distances in half widths, per mm. */
static double scale_of(const sdm_grid *grid)
{
    const double *h = grid->spacing;
    return 1 / (HALF_WIDTH * fmax(h[0], fmax(h[1], h[2])));
}

sdm_status sdm_map_volume_adjoint(const sdm_grid *grid, const float *values, int n_threads,
                                  float *adjoint, sdm_error *err)
{
    const sdm_status s = check(grid, values, adjoint, n_threads, err);
    if (s) return s;
    const double *h = grid->spacing, scale = scale_of(grid), unit = scale * h[0] * h[1] * h[2];
    const int64_t n = (int64_t)sdm_grid_count(grid);
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (int64_t i = 0; i < n; i++)
        adjoint[i] = (float)(unit * inside_slope((double)values[i] * scale));
    return SDM_OK;
}

sdm_status sdm_map_volume(const sdm_grid *grid, const float *values, int n_threads, double *volume,
                          sdm_error *err)
{
    double *layer = NULL; // [nz] sums over the voxels of a layer
    sdm_status s = check(grid, values, volume, n_threads, err);
    if (!s) s = SDM_ALLOC(&layer, (size_t)grid->n[2], "volume", err);
    if (s) return s;
    const double *h = grid->spacing, scale = scale_of(grid);
    const int64_t n = grid->n[0] * grid->n[1];
    n_threads = sdm_threads(n_threads);
#pragma omp parallel for schedule(static) num_threads(n_threads) if (n_threads > 1)
    for (int64_t k = 0; k < grid->n[2]; k++)
        for (int64_t i = k * n; i < (k + 1) * n; i++) layer[k] += inside((double)values[i] * scale);
    double sum = 0;
    for (int64_t k = 0; k < grid->n[2]; k++) sum += layer[k];
    sdm_free(layer);
    if (!isfinite(sum))
        return sdm_fail(err, SDM_E_ARG, "volume: the map holds values that are not numbers");
    *volume = sum * h[0] * h[1] * h[2];
    return SDM_OK;
}
