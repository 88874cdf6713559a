/* What is asked of every triangle of a mesh: its normal and how flat it is. */
#ifndef SDM_GEOM_FACET_H
#define SDM_GEOM_FACET_H

#include "point_triangle.h"
#include "sdm/mesh.h"

typedef struct sdm_facet {
    double
        n[3]; /* unit normal, outward; any vector across the longest edge when there is no area */
    double longest; /* length of the longest edge */
    double height;  /* over it; exact to rounding for needles too */
} sdm_facet;

/* Frame of triangle t. */
void sdm_facet_frame(const sdm_mesh *m, size_t t, sdm_frame *f);

/* Mean of the corners of triangle t. */
void sdm_facet_centre(const sdm_mesh *m, size_t t, double x[3]);

/* facet[n_tri]; *area (mm^2) and *volume (mm^3, signed, of the cones from `apex`) are set. */
void sdm_facets_build(const sdm_mesh *m, const double apex[3], sdm_facet *facet, double *area,
                      double *volume);

#endif
