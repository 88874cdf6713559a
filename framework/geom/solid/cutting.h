/* Cuts a triangle along segments into convex pieces so that no segment enters the interior of any
 * piece. */
#pragma once

#include "contact.h"

/* A corner of a polygon: its position in the triangle's frame, and the index of the mesh vertex
 * there or SDM_NONE. */
typedef struct sdm_corner {
    double x[2];
    uint32_t vertex;
} sdm_corner;

/* A convex piece: the ranges of its corners and segments in the arrays of sdm_cutter. */
typedef struct sdm_cut_piece {
    size_t first_corner, n_corner, first_segment, n_segment;
} sdm_cut_piece;

/* Scratch memory, reused from one triangle to the next. Zero-initialise; sdm_cutter_dispose()
 * frees. */
typedef struct sdm_cutter {
    sdm_corner *corner, *work_corner;
    double (*segment)[4], (*work_segment)[4]; /* px, py, qx, qy */
    sdm_cut_piece *piece;                     /* the stack */
    size_t cap_corner, cap_segment, cap_piece, cap_work_corner, cap_work_segment;
} sdm_cutter;

/* Cuts the triangle corner[3] along the segments of contacts[n] (coplanar contacts have none) and
 * calls visit(user, corner, n) for each piece; the corners of a piece have the orientation of the
 * triangle. Pieces with area <= tolerance * perimeter are left out. Stops at the first status of
 * visit() other than SDM_OK and returns it; SDM_E_NOMEM. */
sdm_status sdm_cut_triangle(sdm_cutter *w, const sdm_corner corner[3], const sdm_contact *contacts,
                            size_t n, double tolerance,
                            sdm_status (*visit)(void *user, const sdm_corner *corner, size_t n),
                            void *user, sdm_error *err);
void sdm_cutter_dispose(sdm_cutter *c);
