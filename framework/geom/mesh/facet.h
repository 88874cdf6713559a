/* Normal, longest edge and height of every triangle of a mesh. */
#pragma once

#include "point_triangle.h"
#include "sdm/mesh.h"

typedef struct sdm_facet {
    /* outward unit normal; for a triangle without area any unit vector perpendicular to its longest
     * edge */
    double n[3];
    double longest; /* length of the longest edge, mm */
    double height;  /* over the longest edge, mm; accurate to rounding for needles too */
} sdm_facet;

/* *f = the frame of triangle t (point_triangle.h). */
void sdm_facet_frame(const sdm_mesh *m, size_t t, sdm_frame *f);

/* x = centroid of triangle t. */
void sdm_facet_centre(const sdm_mesh *m, size_t t, double x[3]);

/* Fills facet[n_tri]. *area = surface area, mm^2. *volume = signed volume, mm^3, summed over the
 * tetrahedra of the triangles with `apex`; a point near the mesh keeps the rounding error small. */
void sdm_facets_build(const sdm_mesh *m, const double apex[3], sdm_facet *facet, double *area,
                      double *volume);
