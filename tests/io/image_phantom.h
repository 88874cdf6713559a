/* An asymmetric phantom for image files: three different sizes and spacings, an oblique frame,
 * and a value that identifies each voxel. */
#ifndef SDM_TEST_PHANTOM_H
#define SDM_TEST_PHANTOM_H

#include <math.h>

#include "sdm/grid.h"

#define PHANTOM_NX 7
#define PHANTOM_NY 5
#define PHANTOM_NZ 9
#define PHANTOM_COUNT (PHANTOM_NX * PHANTOM_NY * PHANTOM_NZ)

/* The grid of the phantom; `mirror` gives a left-handed frame. */
static inline sdm_grid phantom_grid(int mirror)
{
    sdm_grid g = {.n = {PHANTOM_NX, PHANTOM_NY, PHANTOM_NZ},
                  .origin = {-12.25, 31.5, 7.125},
                  .spacing = {0.2, 0.35, 1.25}};
    const double a = 0.5, b = 1.1, c = -0.3, ca = cos(a), sa = sin(a), cb = cos(b), sb = sin(b),
                 cc = cos(c), sc = sin(c);
    const double r[9] = {ca * cb,
                         ca * sb * sc - sa * cc,
                         ca * sb * cc + sa * sc,
                         sa * cb,
                         sa * sb * sc + ca * cc,
                         sa * sb * cc - ca * sc,
                         -sb,
                         cb * sc,
                         cb * cc};
    for (int i = 0; i < 9; i++) g.dir[i] = mirror && i % 3 == 2 ? -r[i] : r[i];
    return g;
}

/* v[PHANTOM_COUNT]: the values of the voxels, x fastest. */
static inline void phantom_values(float *v)
{
    for (int i = 0; i < PHANTOM_COUNT; i++) {
        const int x = i % PHANTOM_NX, y = i / PHANTOM_NX % PHANTOM_NY,
                  z = i / (PHANTOM_NX * PHANTOM_NY);
        v[i] = (float)(0.1 * x - 3.0 * y + 100.0 * z);
    }
}

#endif
