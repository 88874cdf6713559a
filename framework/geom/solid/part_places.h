/* Places on the surface of a part, as many for each mm^2 everywhere, also within large triangles.
 */
#pragma once

#include <math.h>

#include "sdm/mesh.h"

/* Zero-initialise. */
typedef struct part_places {
    double area; /* of the triangles of the part so far, mm^2: the caller adds them */
    size_t n;    /* places so far */
} part_places;

/* x[3] = the next place in triangle t, of which area is already part; false: it has no more. In all
 * there are `most` places on a part of the area `whole`: number k lies where the sum of the areas
 * passes (k + 1/2) / most of it. Within a triangle they follow the golden ratio, so that no ray
 * from them meets an edge on the other side of a symmetric part. */
static inline bool part_places_next(part_places *p, size_t most, double whole, const sdm_mesh *m,
                                    size_t t, double x[3])
{
    if (p->n == most || !((double)most * p->area > ((double)p->n + 0.5) * whole)) return false;
    p->n++;
    const double u = fmod(0.754877666 * (double)p->n, 1), v = fmod(0.569840291 * (double)p->n, 1),
                 root = sqrt(u), share[3] = {1 - root, root * (1 - v), root * v};
    for (size_t d = 0; d < 3; d++) {
        x[d] = 0;
        for (size_t k = 0; k < 3; k++)
            x[d] += share[k] * m->vert[3 * (size_t)m->tri[3 * t + k] + d];
    }
    return true;
}
