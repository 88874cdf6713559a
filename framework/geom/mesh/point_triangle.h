/* Closest point on a triangle, in double, without any tolerance: a triangle of no area is a segment
 * or a point. */
#ifndef SDM_GEOM_POINT_TRIANGLE_H
#define SDM_GEOM_POINT_TRIANGLE_H

#include <stdint.h>

/* Where on the triangle the closest point lies: a corner, the edge from corner i to i + 1, or the
 * face. */
enum { SDM_CORNER_0, SDM_CORNER_1, SDM_CORNER_2, SDM_EDGE_0, SDM_EDGE_1, SDM_EDGE_2, SDM_FACE };

/* A triangle in a frame of its own: origin a at the start of its longest edge, u along that edge, v
   in the plane towards the third corner, n = u x v outward. The corners are (0, 0), (2 half[0], 0)
   and (cx, cy >= 0) in (u, v). Whatever the triangle's shape the frame is orthonormal to rounding,
   so slivers and needles lose no accuracy. Edge k has a coordinate t_k along it, zero at its
   middle, and h_k across, positive outside: t_0 = x - half[0], h_0 = -y; t_k = ex x + ey y - kt,
   h_k = ey x - ex y - kh for k = 1, 2 (kh is 0 for k = 2). */
typedef struct sdm_frame {
    double a[3], u[3], v[3], n[3];
    double half[3]; /* half lengths of the edges */
    double e1x, e1y, kt1, kh1;
    double e2x, e2y, kt2;
    double rotation; /* corner of the triangle at a: 0, 1 or 2 */
    double flat;     /* 1: a triangle of no area */
} sdm_frame;

void sdm_frame_build(const double a[3], const double b[3], const double c[3], sdm_frame *f);

/* Height over the longest edge. */
double sdm_frame_height(const sdm_frame *f);

/* Does p project into the face? Never for a triangle of no area. */
int sdm_frame_above(const sdm_frame *f, const double p[3]);

/* Squared distance from p. */
double sdm_frame_distance2(const sdm_frame *f, const double p[3]);

/* Squared distance, closest point q and where it lies. */
double sdm_frame_closest(const sdm_frame *f, const double p[3], double q[3], int *feature);

#endif
