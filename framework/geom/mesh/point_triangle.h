/* Closest point on a triangle, in double precision and without any tolerance. A triangle without
 * area acts as a segment or a point. */
#pragma once

#include <stdint.h>

/* The feature of a triangle on which the closest point lies: corner i, the edge from corner i to
 * corner (i + 1) % 3, or the interior of the face. */
enum { SDM_CORNER_0, SDM_CORNER_1, SDM_CORNER_2, SDM_EDGE_0, SDM_EDGE_1, SDM_EDGE_2, SDM_FACE };

/* A triangle and its own orthonormal frame: origin a at the start of the longest edge, u along that
 * edge, v in the plane towards the third corner, n = u x v outward. With (x, y) the coordinates
 * along u and v, the corners are (0, 0), (2 half[0], 0) and (cx, cy), cy >= 0. The frame is
 * orthonormal to rounding for every triangle, so slivers and needles lose no accuracy. Edge k
 * (k = 0: the longest) has a coordinate t_k along it, 0 at its midpoint, and a signed distance h_k
 * from its line, positive outside the triangle:
 *   t_0 = x - half[0],          h_0 = -y,
 *   t_1 = e1x x + e1y y - kt1,  h_1 = e1y x - e1x y - kh1,
 *   t_2 = e2x x + e2y y - kt2,  h_2 = e2y x - e2x y. */
typedef struct sdm_frame {
    double a[3], u[3], v[3], n[3];
    double half[3]; /* half the lengths of the edges */
    double e1x, e1y, kt1, kh1;
    double e2x, e2y, kt2;
    double rotation; /* index of the triangle's corner at a: 0, 1 or 2 */
    double flat;     /* 1: the triangle has no area; v and n are then arbitrary; else 0 */
} sdm_frame;

/* *f = frame of the triangle with corners a, b, c, counter-clockwise seen from outside. */
void sdm_frame_build(const double a[3], const double b[3], const double c[3], sdm_frame *f);

/* Height of the triangle over its longest edge; 0 without area. */
double sdm_frame_height(const sdm_frame *f);

/* 1 when the perpendicular projection of p lies on the face, edges included, else 0; always 0 for a
 * triangle without area. */
int sdm_frame_above(const sdm_frame *f, const double p[3]);

/* Squared distance from p to the triangle. */
double sdm_frame_distance2(const sdm_frame *f, const double p[3]);

/* Returns the squared distance from p to the triangle; q = closest point, *feature = where it lies
 * (SDM_CORNER_0 ... SDM_FACE, in the corners as given to sdm_frame_build()). */
double sdm_frame_closest(const sdm_frame *f, const double p[3], double q[3], int *feature);
