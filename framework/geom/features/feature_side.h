/* The side of a surface that bounds a solid on which a point lies, from its nearest feature.

   The region of an edge or a corner meets the surface only at the edge or the corner itself. It
   therefore lies entirely outside the solid (at a convex edge) or entirely inside (at a concave
   one). The region of a face lies on both sides of it. */
#pragma once

#include <float.h>
#include <math.h>

#include "nearest.h"

/* Elements of sdm_features.side: the region lies inside or outside the solid; the point lies
   outside when it lies on the outer side of the feature's owner (a face; an edge or a corner whose
   faces lie in one plane); not known (more than two faces at an edge, narrow faces, and others). */
enum { SDM_SIDE_INSIDE = -1, SDM_SIDE_UNKNOWN = 0, SDM_SIDE_OUTSIDE = 1, SDM_SIDE_OF_OWNER = 2 };

/* side[n->features.end] = the element for each feature; *n is not changed. The surface must bound a
   solid: outside in front of all triangles, inside behind them. SDM_E_NOMEM. */
sdm_status sdm_feature_sides_find(const sdm_nearest *n, int8_t *side, sdm_error *err);

/* Largest squared distance of a feature that may be the nearest one of p, if rounding decided; d2:
   squared distance of the nearest one. If the sides by all such features agree, the side is
   certain.
   */
static inline double sdm_tied_distance2(const sdm_features *f, const double p[3], double d2)
{
    double largest = f->radius;
    for (int a = 0; a < 3; a++)
        largest = fmax(largest, f->radius + fmax(fabs(p[a]), fabs(f->centre[a])));
    const double far = sqrt(d2) * (1 + 1e-10) + 256 * DBL_EPSILON * largest;
    return far * far;
}

/* Side of point p, whose nearest feature is `number`: SDM_SIDE_OUTSIDE, SDM_SIDE_INSIDE, or
   SDM_SIDE_UNKNOWN. Wrong only where p lies on the surface up to rounding. */
static inline int sdm_feature_side(const sdm_features *f, uint32_t number, const double p[3])
{
    const int8_t side = f->side[number];
    const double *a = f->exact[number].a, *n = f->exact[f->owner[number]].u;
    const double height = (p[0] - a[0]) * n[0] + (p[1] - a[1]) * n[1] + (p[2] - a[2]) * n[2];
    // without branches: the sides of neighbours differ too often to be foreseen
    const int of_owner = (height > 0) - (height < 0);
    return side == SDM_SIDE_OF_OWNER ? of_owner : (int)side;
}
