/* Squared distance in double from a point to a feature: every value of a distance map is the square
   root of such a distance. */
#pragma once

#include <math.h>

#include "surface_features.h"

/* Largest value of a region function in a region, relative to the distance from the feature plus
   the longest edge: twice the rounding error of a gradient in float. With the rounding errors of
   the kernels it is less than their margins (error), so they keep every feature that passes. */
#define SDM_REGION_SLACK 1.2e-7

/* Value at w of the region function in a row and a lane of a group, without its offset. */
static inline double sdm_region_function(const sdm_feature_group *g, size_t row, size_t lane,
                                         const double w[3])
{
    return (double)g->g[row][0][lane] * w[0] + (double)g->g[row][1][lane] * w[1] +
           (double)g->g[row][2][lane] * w[2];
}

/* Is the point at w, relative to a point of edge or corner `number`, within the region of this
   feature, up to SDM_REGION_SLACK? For an edge its two ends are not tested. */
static inline int sdm_in_region(const sdm_features *f, uint32_t number, const double w[3])
{
    const uint32_t place = f->place[number - f->edge_base];
    const sdm_feature_group *g = &f->group[place / 8];
    const size_t lane = place % 8;
    const double size = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    const double most = SDM_REGION_SLACK * (size + 1 / f->scale);
    if (number < f->corner_base)
        return (g->most[1][lane] == INFINITY || sdm_region_function(g, 1, lane, w) <= most) &&
               sdm_region_function(g, 2, lane, w) <= most;
    for (size_t k = 0; k < 6; k++)
        if (!(sdm_region_function(g, k % 3, lane + k / 3 * SDM_CORNER_LANES, w) <= most)) return 0;
    return 1;
}

/* Squared distance (mm^2) from p to feature `number`; INFINITY if it is > most, where p does not
   project into the face or the edge, or lies outside of the region of the edge or the corner. A
   feature whose region does not hold p may be as near as the nearest one up to rounding (an edge
   and its end); since it is left out here, the smallest distance over the features does not depend
   on how many of these are compared. frames[slot]: the frames of the surface's triangles. The
   operations and their order are those of distances4(), hence the same bits. */
static inline double sdm_feature_distance2(const sdm_features *f, const sdm_frame *frames,
                                           uint32_t number, const double p[3], double most)
{
    const sdm_feature *k = &f->exact[number];
    const double w[3] = {p[0] - k->a[0], p[1] - k->a[1], p[2] - k->a[2]};
    const double s = w[0] * k->u[0] + w[1] * k->u[1] + w[2] * k->u[2];
    if (number < f->edge_base)
        return s * s <= most && sdm_frame_above(&frames[number], p) ? s * s : INFINITY;
    if (number < f->corner_base && !(s >= 0 && s <= k->length)) return INFINITY;
    const double rx = w[0] - s * k->u[0], ry = w[1] - s * k->u[1], rz = w[2] - s * k->u[2];
    const double d2 = rx * rx + ry * ry + rz * rz;
    return d2 <= most && sdm_in_region(f, number, w) ? d2 : INFINITY;
}

/* Is feature `number` at squared distance d taken before feature `best` at squared distance least,
   the nearest one so far (least = INFINITY: none)? Of equally near features the one with the
   highest number is taken, so corners before edges before faces: where an edge and its end are
   equally near, the point always lies in the region of the end, but not always in that of the edge.
 */
static inline int sdm_is_nearer(double d, uint32_t number, double least, uint32_t best)
{
    return d < least || (d == least && d < INFINITY && number > best);
}
