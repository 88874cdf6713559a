/* Rings of vertices around the centreline of the cochlea. */
#pragma once

#include <stddef.h>

#include "cochlea_curve.h"

/* A ring lies in the cross-section at a fraction of the apical angle. The rings of the caps are
   scaled by `shrink` and moved by `ahead` tube radii along the tangent. */
typedef struct cochlea_ring {
    double fraction, shrink, ahead;
    /* true: the ring is never cut off; so for the rings of the caps, and the first and last ring of
       the tube */
    bool whole;
} cochlea_ring;

typedef void cochlea_put(void *user, size_t vertex, const dual at[3]);

/* Calls put() for the n_sectors vertices of a ring, numbered from `first`. x: the unknowns;
   direction[n_sectors][2]: cosine and sine of the vertex angles; left: the ring is mirrored in
   y. */
void sdm_cochlea_ring_at(const cochlea_model *m, const double *x, const cochlea_ring *r,
                         size_t n_sectors, const double *direction, bool left, size_t first,
                         cochlea_put *put, void *user);
