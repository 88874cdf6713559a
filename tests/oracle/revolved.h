/* A closed mesh of rings about the z axis, for shapes of tests. */
#ifndef SDM_TEST_REVOLVED_H
#define SDM_TEST_REVOLVED_H

#include <math.h>
#include <stdint.h>
#include <string.h>

#include "sdm/shape.h"

/* A ring of vertices around the z axis: *r = radius and *z = height (mm) of ring i, where the shape
 * has the parameters p. */
typedef void revolved_ring(const double *p, int i, double *r, double *z);

/* mesh() of a shape: n_rings rings of `around` vertices, from the first, next to the vertex (0, 0,
 * low), to the last, next to (0, 0, high). Seen from outside, the rings go up. */
static inline int revolved_mesh(const sdm_host *host, sdm_mesh_out *out, uint32_t n_rings,
                                uint32_t around, revolved_ring *ring, const double *p, double low,
                                double high)
{
    const uint32_t below = n_rings * around, above = below + 1, last = below - around;
    const int failed = host->reserve(host, out, above + 1, (size_t)2 * below);
    if (failed) return failed;
    double *v = out->vert;
    for (uint32_t i = 0; i < n_rings; i++)
        for (uint32_t j = 0; j < around; j++, v += 3) {
            const double turn = 2 * 3.14159265358979324 * j / around;
            double r;
            ring(p, (int)i, &r, &v[2]);
            v[0] = r * cos(turn), v[1] = r * sin(turn);
        }
    v[0] = v[1] = v[3] = v[4] = 0, v[2] = low, v[5] = high;
    uint32_t *t = out->tri;
    for (uint32_t j = 0; j < around; j++) {
        const uint32_t k = (j + 1) % around, ends[] = {below, k, j, last + j, last + k, above};
        memcpy(t, ends, sizeof ends);
        t += 6;
        for (uint32_t a = 0; a < last; a += around, t += 6) {
            const uint32_t b = a + around, quad[] = {a + j, a + k, b + k, a + j, b + k, b + j};
            memcpy(t, quad, sizeof quad);
        }
    }
    return 0;
}

#endif
