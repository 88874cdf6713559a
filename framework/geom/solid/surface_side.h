/* What lies outside of a place on the surface of a closed mesh: which parts of the surface bound
   the union of what it encloses. */
#ifndef SDM_GEOM_SURFACE_SIDE_H
#define SDM_GEOM_SURFACE_SIDE_H

#include "survey.h"

/* Winding number just outside of the surface, known for triangles that meet nothing; for those that
   meet others it is carried on from a place where it is known. Zero-initialise;
   sdm_sides_dispose(). */
typedef struct sdm_sides {
    const sdm_mesh *mesh;
    const sdm_survey *survey;
    int32_t *outside; /* [n_tri] of triangles that meet nothing */
    /* the triangle at hand */
    uint32_t tri;
    sdm_frame frame;
    bool simple, known; /* all that it meets passes through it; `start` is set */
    double start[2];    /* a place on it */
    int start_outside;  /* and the winding number there */
    uint32_t *skip;     /* the triangle and what lies on it */
    size_t cap_skip;
} sdm_sides;

/* Is the triangle flat, so that its neighbours stand for it? */
bool sdm_sides_flat(const sdm_survey *s, uint32_t t);

/* outside[] is taken from the high end of the arena. One ray for each patch of triangles that meet
   nothing: the winding number does not change across an edge between two of them. */
sdm_status sdm_sides_build(const sdm_mesh *m, const sdm_survey *survey, sdm_arena *arena,
                           sdm_sides *s, sdm_error *err);
void sdm_sides_dispose(sdm_sides *s);

/* Is the triangle, which meets nothing, boundary of the solid? */
bool sdm_sides_keep_whole(const sdm_sides *s, uint32_t t);

/* Turns to a triangle that meets others; its frame is set. */
void sdm_sides_turn_to(sdm_sides *s, uint32_t t);
/* Is it boundary of the solid at xy (of its frame), and does it stand for what lies on it there? */
sdm_status sdm_sides_keep(sdm_sides *s, const double xy[2], bool *keep, sdm_error *err);

#endif
