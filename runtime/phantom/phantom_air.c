/* Air cells of phantoms: balls with random centres in randomly chosen cubes of a lattice fixed in
   the world. */
#include <math.h>

#include "phantom_parts.h"
#include "sdm/internal/rng.h"
#include "sdm/memory.h"

#define REACH ((int64_t)1 << 20) // |cube index| < REACH, so that three indices fit into 63 bits

/* Finds the range first[3] .. last[3] of the lattice cubes whose ball may intersect the box.
   SDM_E_ARG for too many cubes. */
static sdm_status find_cubes(const sdm_phantom_opts *o, const double min[3], const double max[3],
                             int64_t first[3], int64_t last[3], sdm_error *err)
{
    double cubes = 1;
    for (int a = 0; a < 3; a++) {
        const double from = floor(min[a] / o->air_mm - 0.5), to = floor(max[a] / o->air_mm + 0.5);
        if (!(from > -REACH) || !(to < REACH))
            return sdm_fail(err, SDM_E_ARG,
                            "air cells of %g mm are too small for a grid that reaches %g mm from 0",
                            o->air_mm, fmax(fabs(min[a]), fabs(max[a])));
        first[a] = (int64_t)from, last[a] = (int64_t)to;
        cubes *= to - from + 1;
    }
    if (cubes > 1e8)
        return sdm_fail(err, SDM_E_ARG,
                        "air cells of %g mm: %.0f cubes in the grid, at most 1e8; make them larger",
                        o->air_mm, cubes);
    return SDM_OK;
}

/* Returns the number of balls in the cubes first .. last, and writes their centres unless `centre`
   is NULL. */
static size_t list_balls(const sdm_phantom_opts *o, const int64_t first[3], const int64_t last[3],
                         double (*centre)[3])
{
    size_t n = 0;
    for (int64_t k = first[2]; k <= last[2]; k++)
        for (int64_t j = first[1]; j <= last[1]; j++)
            for (int64_t i = first[0]; i <= last[0]; i++) {
                const uint64_t number = (uint64_t)(k + REACH) << 42 | (uint64_t)(j + REACH) << 21 |
                                        (uint64_t)(i + REACH);
                uint32_t r[4];
                sdm_rng_block(o->seed, PHANTOM_STREAM_AIR, number, r);
                if (!(r[3] * 0x1p-32 < o->air_share)) continue;
                const int64_t cube[3] = {i, j, k};
                for (int a = 0; a < 3 && centre; a++)
                    centre[n][a] = o->air_mm * ((double)cube[a] + r[a] * 0x1p-32);
                n++;
            }
    return n;
}

sdm_status phantom_balls_make(const sdm_phantom_opts *o, const double min[3], const double max[3],
                              phantom_balls *out, sdm_error *err)
{
    int64_t first[3], last[3];
    sdm_status s = find_cubes(o, min, max, first, last, err);
    if (s) return s;
    *out = (phantom_balls){.n = list_balls(o, first, last, NULL), .radius = 0.5 * o->air_mm};
    s = SDM_ALLOC(&out->centre, out->n, "air cells", err);
    if (!s) (void)list_balls(o, first, last, out->centre);
    return s;
}

void phantom_balls_dispose(phantom_balls *b)
{
    sdm_free(b->centre);
    *b = (phantom_balls){0};
}

/* *first .. *last - 1 = the indices within `half` of `centre` on an axis of n voxels. */
static void index_range(double centre, double half, int64_t n, int64_t *first, int64_t *last)
{
    *first = (int64_t)fmax(ceil(centre - half), 0);
    *last = (int64_t)fmin(floor(centre + half) + 1, (double)n);
}

void phantom_balls_plane(const phantom_balls *b, const sdm_grid *grid, size_t k, double reach,
                         float *distance)
{
    const int64_t nx = grid->n[0], ny = grid->n[1];
    const double *h = grid->spacing, far = b->radius + reach;
    for (int64_t i = 0; i < nx * ny; i++) distance[i] = (float)reach;
    for (size_t n = 0; n < b->n; n++) {
        double c[3];
        int64_t x0, x1, y0, y1;
        sdm_grid_index(grid, b->centre[n], c);
        const double dz = ((double)k - c[2]) * h[2];
        // only the square around the ball
        if (fabs(dz) > far) continue;
        index_range(c[0], far / h[0], nx, &x0, &x1);
        index_range(c[1], far / h[1], ny, &y0, &y1);
        for (int64_t y = y0; y < y1; y++)
            for (int64_t x = x0; x < x1; x++) {
                const double dx = ((double)x - c[0]) * h[0], dy = ((double)y - c[1]) * h[1];
                float *d = &distance[y * nx + x];
                *d = fminf(*d, (float)(sqrt(dx * dx + dy * dy + dz * dz) - b->radius));
            }
    }
}
