/* Cutting a convex polygon along segments into convex pieces whose interior no segment enters. */
#ifndef SDM_GEOM_CUTTING_H
#define SDM_GEOM_CUTTING_H

#include "contact.h"

/* A corner of a polygon: its position, and the mesh vertex there or SDM_NONE. */
typedef struct sdm_corner {
    double x[2];
    uint32_t vertex;
} sdm_corner;

typedef struct sdm_cut_piece {
    size_t first_corner, n_corner, first_segment, n_segment;
} sdm_cut_piece;

/* Memory kept from one polygon to the next; zero-initialise, sdm_cutter_dispose(). */
typedef struct sdm_cutter {
    sdm_corner *corner, *work_corner;
    double (*segment)[4], (*work_segment)[4]; /* px, py, qx, qy */
    sdm_cut_piece *piece;
    size_t cap_corner, cap_segment, cap_piece, cap_work_corner, cap_work_segment;
} sdm_cutter;

/* Cuts the triangle corner[3] along the segments among contacts[n] and calls visit(user, corners,
   n) for each piece, corners in the triangle's sense of rotation; pieces narrower than the
   tolerance are left out. Stops at the first status that is not SDM_OK. */
sdm_status sdm_cut_triangle(sdm_cutter *c, const sdm_corner corner[3], const sdm_contact *contacts,
                            size_t n, double tolerance,
                            sdm_status (*visit)(void *user, const sdm_corner *corner, size_t n),
                            void *user, sdm_error *err);
void sdm_cutter_dispose(sdm_cutter *c);

#endif
