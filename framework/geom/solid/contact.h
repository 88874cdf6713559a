/* Where the triangles of a mesh meet other than along shared edges and corners. */
#ifndef SDM_GEOM_CONTACT_H
#define SDM_GEOM_CONTACT_H

#include "memory/budget.h"
#include "mesh/bvh.h"
#include "mesh/facet.h"
#include "mesh/topology.h"

typedef enum sdm_contact_kind {
    SDM_CONTACT_CROSSING, /* `other` and `tri` pass through each other along the segment p q, no
                             corner on the other's plane */
    SDM_CONTACT_TOUCH,    /* as before, but some corner lies on the other's plane */
    SDM_CONTACT_COPLANAR  /* `other` lies on `tri` and covers a part of it; no segment */
} sdm_contact_kind;

/* One meeting as seen by `tri`; each pair of triangles gives contacts for both. */
typedef struct sdm_contact {
    uint32_t tri, other;
    sdm_contact_kind kind;
    double p[2], q[2]; /* in the frame of tri */
} sdm_contact;

/* Contacts sorted by triangle: those of t are list[first[t] .. first[t + 1]). */
typedef struct sdm_contacts {
    sdm_contact *list;
    uint32_t *first;
    size_t n;
    size_t crossing_pairs; /* pairs that share no vertex */
    double
        tolerance; /* length below which two things coincide: a few roundings of the coordinates */
    double error;  /* largest distance by which a vertex was moved onto a plane */
} sdm_contacts;

/* facets[n_tri]; triangles that are not higher than the tolerance meet nothing. Taken from the high
   end of the arena. *c is zero-initialised; budget may be NULL. */
sdm_status sdm_contacts_find(const sdm_mesh *m, const sdm_topology *topo, const sdm_bvh *tree,
                             const sdm_facet *facets, sdm_arena *arena, sdm_contacts *c,
                             sdm_budget *budget, sdm_error *err);

/* Position of x in the frame's plane, and back. */
void sdm_frame_flatten(const sdm_frame *f, const double x[3], double xy[2]);
void sdm_frame_lift(const sdm_frame *f, const double xy[2], double x[3]);

#endif
