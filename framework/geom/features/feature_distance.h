/* Squared distance in double from a point to a feature: every value of a distance map is the square
   root of such a distance. */
#pragma once

#include <math.h>

#include "surface_features.h"

/* Squared distance (mm^2) from p to feature `number`; INFINITY where p does not project into the
   face or the edge. frames[slot]: the frames of the surface's triangles. The operations and their
   order are those of distances4() of the map kernels, hence the same bits. */
static inline double sdm_feature_distance2(const sdm_features *f, const sdm_frame *frames,
                                           uint32_t number, const double p[3])
{
    const sdm_feature *k = &f->exact[number];
    const double wx = p[0] - k->a[0], wy = p[1] - k->a[1], wz = p[2] - k->a[2];
    const double s = wx * k->u[0] + wy * k->u[1] + wz * k->u[2];
    if (number < f->edge_base) return sdm_frame_above(&frames[number], p) ? s * s : INFINITY;
    if (number < f->corner_base && !(s >= 0 && s <= k->length)) return INFINITY;
    const double rx = wx - s * k->u[0], ry = wy - s * k->u[1], rz = wz - s * k->u[2];
    return rx * rx + ry * ry + rz * rz;
}
