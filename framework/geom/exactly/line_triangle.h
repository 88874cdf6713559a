/* Exact decisions on where a line parallel to the first coordinate axis meets a triangle. */
#pragma once

/* Does the line through (any, p[0], p[1]), parallel to the first axis, meet the triangle with
 * corners v[3][3]? 0: no. +1 or -1: yes, with the sign of the first component of the triangle's
 * normal. The line is moved by an infinitesimal vector (predicates.h), so it never meets an edge or
 * a corner and crosses each sheet of a closed mesh exactly once. area[i] = twice the signed area,
 * rounded, of the projected triangle formed by p and the edge opposite corner i. */
int sdm_line_meets(const double v[3][3], const double p[2], double area[3]);

/* On which side of p does the line through p[3], parallel to the first axis, meet the triangle v?
 * `orientation` (not 0) and `area` are the results of sdm_line_meets() for (p[1], p[2]). Returns
 * the sign of (first coordinate of the intersection) - p[0]; 0 when p lies on the triangle. */
int sdm_line_meets_after(const double v[3][3], const double p[3], int orientation,
                         const double area[3]);
