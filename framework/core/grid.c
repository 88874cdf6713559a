/* Regular grid: checks and conversion of coordinates. */
#include "sdm/grid.h"

#include <math.h>

sdm_grid sdm_grid_centred(const int64_t n[3], double spacing, const double centre[3])
{
    sdm_grid g = {.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    for (int a = 0; a < 3; a++) {
        g.n[a] = n[a];
        g.spacing[a] = spacing;
        g.origin[a] = centre[a] - 0.5 * (double)(n[a] - 1) * spacing;
    }
    return g;
}

sdm_status sdm_grid_check(const sdm_grid *g, sdm_error *err)
{
    static const char axis[] = "xyz";
    for (int a = 0; a < 3; a++) {
        if (g->n[a] < 1 || g->n[a] > 1 << 20)
            return sdm_fail(err, SDM_E_ARG, "grid size along %c is %lld, need 1 to 1048576",
                            axis[a], (long long)g->n[a]);
        // these bounds also keep the squares of spacings finite and normal
        if (!(g->spacing[a] >= 1e-100) || !(g->spacing[a] <= 1e100))
            return sdm_fail(
                err, SDM_E_ARG,
                "grid spacing along %c is %g mm, need a positive number (1e-100 to 1e100)", axis[a],
                g->spacing[a]);
        if (!(fabs(g->origin[a]) <= 1e100))
            return sdm_fail(err, SDM_E_ARG,
                            "grid origin along %c is %g mm, need a finite number up to 1e100",
                            axis[a], g->origin[a]);
    }
    // each size is at most 2^20, so the product of three does not overflow int64
    if ((uint64_t)(g->n[0] * g->n[1] * g->n[2]) > SIZE_MAX / sizeof(double) / 4)
        return sdm_fail(err, SDM_E_ARG,
                        "grid of %lld x %lld x %lld voxels is more than memory can hold",
                        (long long)g->n[0], (long long)g->n[1], (long long)g->n[2]);
    for (int a = 0; a < 3; a++) {
        for (int b = 0; b < 3; b++) {
            double dot = 0;
            for (int k = 0; k < 3; k++) dot += g->dir[3 * k + a] * g->dir[3 * k + b];
            if (!(fabs(dot - (a == b)) <= 1e-6))
                return sdm_fail(
                    err, SDM_E_ARG,
                    "grid direction is not orthonormal: columns %d and %d have the product %g", a,
                    b, dot);
        }
    }
    return SDM_OK;
}

size_t sdm_grid_count(const sdm_grid *g)
{
    return (size_t)g->n[0] * (size_t)g->n[1] * (size_t)g->n[2];
}

size_t sdm_grid_voxel(const sdm_grid *g, int64_t i, int64_t j, int64_t k)
{
    return ((size_t)k * (size_t)g->n[1] + (size_t)j) * (size_t)g->n[0] + (size_t)i;
}

void sdm_grid_world(const sdm_grid *g, const double index[3], double world[3])
{
    for (int a = 0; a < 3; a++) {
        world[a] = g->origin[a];
        for (int b = 0; b < 3; b++) world[a] += g->dir[3 * a + b] * g->spacing[b] * index[b];
    }
}

void sdm_grid_index(const sdm_grid *g, const double world[3], double index[3])
{
    const double d[3] = {world[0] - g->origin[0], world[1] - g->origin[1], world[2] - g->origin[2]};
    for (int b = 0; b < 3; b++)
        index[b] = (g->dir[b] * d[0] + g->dir[3 + b] * d[1] + g->dir[6 + b] * d[2]) / g->spacing[b];
}
