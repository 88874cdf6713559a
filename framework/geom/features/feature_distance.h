/* Squared distance from a point to a feature in double: what a map's values are made of. */
#ifndef SDM_GEOM_FEATURE_DISTANCE_H
#define SDM_GEOM_FEATURE_DISTANCE_H

#include <math.h>

#include "surface_features.h"

/* INFINITY where p does not project into the face or the edge. The same operations as the kernels
 * do for the nearest feature. */
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

#endif
