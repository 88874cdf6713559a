/* Rings of vertices about the centreline of the cochlea. */
#ifndef COCHLEA_RING_H
#define COCHLEA_RING_H

#include <stddef.h>

#include "cochlea_curve.h"

/* The section at a share of the apical angle, on a cap moved `ahead` along the tangent and shrunk;
 * both in radii of the tube. */
typedef struct cochlea_ring {
    double share, shrink, ahead;
    bool whole; /* not cut off: rings of the caps, and the two they start from */
} cochlea_ring;

typedef void cochlea_put(void *user, size_t vertex, const dual at[3]);

/* Calls put() for the vertices of a ring at the unknowns x, numbered from `first`.
   direction[n_sectors][2]: cosine and sine of their angles. left: mirrored in y. */
void sdm_cochlea_ring_at(const cochlea_model *m, const double *x, const cochlea_ring *r,
                         size_t n_sectors, const double *direction, bool left, size_t first,
                         cochlea_put *put, void *user);

#endif
