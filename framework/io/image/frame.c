/* Turns the steps from voxel to voxel in an image header into a grid with orthonormal axes. */
#include <math.h>

#include "image_readers.h"

/* Largest accepted displacement, in voxels, of a corner voxel by the rounding of numbers in a
   header. */
#define SHIFT_MAX 0.1
/* Newton steps; each one doubles the number of correct digits. */
#define NEWTON_STEPS 12

static void cross(const double a[3], const double b[3], double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
}

/* Replaces m[3][3] by the nearest orthonormal matrix, its polar factor, with Newton's iteration
   X <- (X + X^-T) / 2 (Higham 1986). False for a singular matrix. Row-major and column-major
   storage give the same result. */
static bool orthonormalise(double m[9])
{
    for (int round = 0; round < NEWTON_STEPS; round++) {
        double c[9]; // the cofactors, det(X) X^-T
        for (int i = 0; i < 3; i++) cross(m + 3 * ((i + 1) % 3), m + 3 * ((i + 2) % 3), c + 3 * i);
        const double det = m[0] * c[0] + m[1] * c[1] + m[2] * c[2];
        if (!(det != 0)) return false;
        for (int i = 0; i < 9; i++) m[i] = 0.5 * (m[i] + c[i] / det);
    }
    return true;
}

/* The largest distance, over the corner voxels, between the positions that the header and the grid
   give to the voxel, in units of the shortest spacing. */
static double largest_shift(const sdm_image_header *h, const sdm_grid *g)
{
    double largest = 0, shortest = INFINITY;
    for (int a = 0; a < 3; a++) shortest = fmin(shortest, g->spacing[a]);
    for (int corner = 1; corner < 8; corner++) {
        double square = 0;
        for (int row = 0; row < 3; row++) {
            double d = 0;
            for (int a = 0; a < 3; a++) {
                const double extent = (corner >> a & 1) * (double)(h->n[a] > 1 ? h->n[a] - 1 : 1);
                d += (h->step[3 * row + a] - g->dir[3 * row + a] * g->spacing[a]) * extent;
            }
            square += d * d;
        }
        if (!(square <= largest * largest))
            largest = sqrt(square); // a NaN is kept; the caller refuses it
    }
    return largest / shortest;
}

sdm_status sdm_frame_grid(const sdm_image_header *h, sdm_grid *out, sdm_error *err)
{
    sdm_grid g = {.dir = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    double dir[9];
    for (int a = 0; a < 3; a++) {
        g.n[a] = h->n[a];
        g.origin[a] = h->origin[a] + 0.0; // turns -0 into 0
        g.spacing[a] = hypot(hypot(h->step[a], h->step[3 + a]), h->step[6 + a]);
        for (int row = 0; row < 3; row++) dir[3 * row + a] = h->step[3 * row + a] / g.spacing[a];
    }
    sdm_status s = sdm_grid_check(&g, err); // sizes, spacing and origin; not yet the directions
    if (s) return SDM_E_FORMAT;
    const bool regular = orthonormalise(dir);
    for (int i = 0; i < 9; i++) g.dir[i] = dir[i] + 0.0;
    const double shift = regular ? largest_shift(h, &g) : INFINITY;
    if (!(shift <= SHIFT_MAX))
        return sdm_fail(err, SDM_E_UNSUPPORTED,
                        "its axes are not at right angles (the nearest straight grid is %.3g "
                        "voxels off at a corner): resample "
                        "it to a straight grid, e.g. in 3D Slicer",
                        shift);
    s = sdm_grid_check(&g, err);
    if (s) return SDM_E_FORMAT;
    *out = g;
    return SDM_OK;
}
