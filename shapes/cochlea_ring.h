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

/* All rings, from the base to the apex, of n_sectors vertices each. */
typedef struct cochlea_rings {
    size_t n, n_sectors;
    cochlea_ring *at; /* [n] */
    /* [2][n_sectors][2] cosine and sine of the vertex angles of even and odd rings */
    double *direction;
} cochlea_rings;

/* *rings = the rings of vertices of the tube with the parameters x, as many as make the mean edge
   of the mesh `edge` mm long. Returns 0; -1: no memory. sdm_cochlea_rings_free() frees them. */
int sdm_cochlea_rings_make(const cochlea_model *m, const double *x, double edge,
                           cochlea_rings *rings);
void sdm_cochlea_rings_free(cochlea_rings *rings);

/* Share of the distance to the centre of curvature at which sections begin to be cut off. */
#define COCHLEA_CUT_FROM 0.90

/* Moves a vertex (x along e1, y along e2) that lies near or beyond the centre of curvature back in
   front of it; bend: curvature vector of the centreline in (e1, e2). */
void sdm_cochlea_cut(const dual bend[2], dual *x, dual *y);

typedef void cochlea_put(void *user, size_t vertex, const dual at[3]);

/* Calls put() for the n_sectors vertices of a ring, numbered from `first`. x: the unknowns;
   direction[n_sectors][2]: cosine and sine of the vertex angles; left: the ring is mirrored in
   y. */
void sdm_cochlea_ring_at(const cochlea_model *m, const double *x, const cochlea_ring *r,
                         size_t n_sectors, const double *direction, bool left, size_t first,
                         cochlea_put *put, void *user);
