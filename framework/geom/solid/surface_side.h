/* Decides which parts of the surface of a closed mesh bound its solid, the points with winding
 * number >= 1: the parts with a winding number <= 0 just outside and >= 1 just inside. */
#pragma once

#include "survey.h"

/* Winding numbers just outside the surface. Zero-initialise; sdm_sides_dispose() frees. */
typedef struct sdm_sides {
    const sdm_mesh *mesh;
    const sdm_survey *survey;
    int32_t *outside; /* [n_tri] winding number outside triangles without contacts */
    /* the current triangle and its frame */
    uint32_t tri;
    sdm_frame frame;
    bool simple;       /* the triangle has only contacts of kind CROSSING, and few of them */
    bool known;        /* start and start_outside are set */
    double start[2];   /* a point of the triangle, in its frame */
    int start_outside; /* winding number just outside the surface at `start` */
    uint32_t *skip;    /* [cap_skip] scratch: the triangle and its coplanar contacts */
    size_t cap_skip;
} sdm_sides;

/* Is triangle t a sliver: not higher than the tolerance? Slivers are left out of the surface,
 * because their neighbours cover them. */
bool sdm_sides_is_sliver(const sdm_survey *survey, uint32_t t);

/* Finds the winding numbers outside[] by one ray for each patch, a set of neighbouring triangles
 * without contacts: the winding number does not change across an edge between two such triangles.
 * outside[] is taken from the high end of the arena. m and survey must outlive *w. SDM_E_NOMEM. */
sdm_status sdm_sides_build(const sdm_mesh *m, const sdm_survey *survey, sdm_arena *arena,
                           sdm_sides *w, sdm_error *err);
void sdm_sides_dispose(sdm_sides *w);

/* True when triangle t, which has no contacts, bounds the solid. */
bool sdm_sides_keep_whole(const sdm_sides *w, uint32_t t);

/* Makes triangle t, which has contacts, the current triangle and sets w->frame. */
void sdm_sides_turn_to(sdm_sides *w, uint32_t t);

/* *keep = true if the current triangle bounds the solid at the point xy of its frame and has the
 * lowest index among the coplanar triangles of the same orientation at this point. SDM_E_NOMEM. */
sdm_status sdm_sides_keep(sdm_sides *w, const double xy[2], bool *keep, sdm_error *err);
