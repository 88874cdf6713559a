/* Contacts: places where two triangles of a mesh intersect or overlap, other than their common
 * vertices and edges. */
#pragma once

#include "mesh/bvh.h"
#include "mesh/facet.h"
#include "mesh/topology.h"

typedef enum sdm_contact_kind {
    /* `tri` and `other` intersect along the segment p q; no corner of one is on the other's plane
     */
    SDM_CONTACT_CROSSING,
    /* `tri` and `other` intersect along p q, and a corner of one is on the other's plane */
    SDM_CONTACT_TOUCH,
    /* `other` is coplanar with `tri` and overlaps it; p and q are not set */
    SDM_CONTACT_COPLANAR
} sdm_contact_kind;

/* A contact of triangle `tri` with triangle `other`; each pair that meets gives contacts to both
 * triangles. */
typedef struct sdm_contact {
    uint32_t tri, other;
    sdm_contact_kind kind;
    double p[2], q[2]; /* (x, y) in the frame of tri */
} sdm_contact;

/* All contacts, sorted by triangle: the contacts of triangle t are list[first[t]] .. list[first[t +
 * 1] - 1]. */
typedef struct sdm_contacts {
    sdm_contact *list; /* [n] */
    uint32_t *first;   /* [n_tri + 1] */
    size_t n;
    size_t crossing_pairs; /* pairs of triangles that meet and share no vertex */
    /* Lengths up to this count as 0, mm: 16 DBL_EPSILON * (largest abs(coordinate)). */
    double tolerance;
    /* largest distance, mm, of a vertex from a plane on which it was taken to lie */
    double error;
} sdm_contacts;

/* Finds all contacts of mesh m, which has facets[n_tri], and fills *c, which is zero-initialised.
 * Triangles not higher than the tolerance have no contacts. The arrays are taken from the high end
 * of the arena. SDM_E_MESH: more than 64 n_tri + 2^20 contacts; SDM_E_NOMEM, SDM_E_CANCELLED. */
sdm_status sdm_contacts_find(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                             const sdm_facet *facets, sdm_arena *arena, sdm_contacts *c,
                             sdm_error *err);

/* sdm_frame_flatten() sets xy to the coordinates of x along u and v of the frame (projection on its
 * plane). sdm_frame_lift() is the inverse: it sets x to the point of the plane at xy. */
void sdm_frame_flatten(const sdm_frame *f, const double x[3], double xy[2]);
void sdm_frame_lift(const sdm_frame *f, const double xy[2], double x[3]);
